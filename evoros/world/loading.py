"""Loads worlds from SDF files, and removes overlaps, which engines undo at different speeds."""

import logging
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from evoros.base.errors import InputError
from evoros.files.resources import find_file, read_file
from evoros.formats.lenient_xml import is_xacro
from evoros.formats.sdf.links import Inertia
from evoros.formats.sdf.reader import SdfWorld, combine_inertias, read_sdf
from evoros.formats.sdf.reading import SdfOptions
from evoros.formats.urdf.packages import index_packages
from evoros.formats.urdf.xacro_expansion import ReadOptions, choose_instead, expand
from evoros.geometry.footprint import lowest_point
from evoros.geometry.overlap import overlap_depth
from evoros.geometry.polyhedron import joint_moments
from evoros.geometry.shapes import Body
from evoros.world.course import Course
from evoros.world.floors import drop_walls, points_between, raise_body, settle
from evoros.world.lifting import SLACK_M, Lifts, Solids, find_lifts, find_sunk
from evoros.world.model import World

_LOG = logging.getLogger(__name__)

_Pairs = dict[tuple[int, int], float]  # overlaps [m] of a movable body and another


def free_bodies(bodies: Sequence[Body], source: str) -> tuple[Body, ...]:
    """Lift, join or fix movable bodies so that none overlaps the ground or another body."""
    if all(body.mass is None for body in bodies):
        return tuple(bodies)
    solids = Solids.of(bodies)
    sunk, pairs = find_sunk(bodies, solids), _find_pairs(bodies, solids)
    if not sunk and not pairs:
        return tuple(bodies)
    lifts = find_lifts(bodies, solids, sunk)
    if lifts.heights:
        bodies = [raise_body(body, lifts.heights.get(i, 0.0)) for i, body in enumerate(bodies)]
        pairs = _find_pairs(bodies, Solids.of(bodies))
    _tell_lifts(bodies, lifts, source)
    return _hold(bodies, pairs, lifts, source)


def _find_pairs(bodies: Sequence[Body], solids: Solids) -> _Pairs:
    pairs: _Pairs = {}
    for shape, i in enumerate(solids.body.tolist()):
        for other in solids.list_near(shape, axes=3) if bodies[i].mass is not None else ():
            j = int(solids.body[other])
            if bodies[j].mass is not None and j < i:
                continue
            depth = overlap_depth(solids[shape], solids[other])
            if depth > SLACK_M:
                pairs[i, j] = max(pairs.get((i, j), 0.0), depth)
    return pairs


def _hold(bodies: Sequence[Body], pairs: _Pairs, lifts: Lifts, source: str) -> tuple[Body, ...]:
    groups = _group_pairs([*pairs, *((i, i) for i in lifts.stuck)])
    fixed = {
        i
        for group in groups
        if any(bodies[i].mass is None or i in lifts.stuck for i in group)
        for i in group
        if bodies[i].mass is not None
    }
    joined = [group for group in groups if fixed.isdisjoint(group)]
    _tell_fixed(bodies, pairs, fixed, lifts, source)
    _tell_joined(bodies, pairs, joined, source)
    held = [
        replace(body, mass=None, inertia=None) if i in fixed else body
        for i, body in enumerate(bodies)
    ]
    for group in joined:
        held[group[0]] = _join_bodies([bodies[i] for i in group])
    absent = {i for group in joined for i in group[1:]}
    return tuple(body for i, body in enumerate(held) if i not in absent)


def _tell_lifts(bodies: Sequence[Body], lifts: Lifts, source: str) -> None:
    depths = lifts.depths
    if depths:
        deepest = max(depths, key=depths.__getitem__)
        carried = len(lifts.heights) - len(depths)
        on_top = f" together with {carried} on top" if carried else ""
        _LOG.warning(
            f"{source}: {_count(depths)} up to {depths[deepest]:.3g} m deep in the ground or in "
            f"a body below ({bodies[deepest].name!r}); they are lifted to the surface{on_top}; "
            "edit <pose> to choose another position"
        )


def _tell_fixed(
    bodies: Sequence[Body], pairs: _Pairs, fixed: set[int], lifts: Lifts, source: str
) -> None:
    if not fixed:
        return
    depths = {i: (depth, "the ground") for i, depth in lifts.stuck.items()}
    for (i, j), depth in pairs.items():
        if bodies[j].mass is None:
            depths[i] = max(depths.get(i, (0.0, "")), (depth, repr(bodies[j].name)))
    deepest = max(depths, key=depths.__getitem__)
    depth, other = depths[deepest]
    _LOG.warning(
        f"{source}: {_count(fixed)} up to {depth:.3g} m deep in fixed bodies, directly or "
        f"through other bodies ({bodies[deepest].name!r} in {other}); they are fixed in place, "
        "so robots cannot push them; edit <pose> to separate the bodies"
    )


def _tell_joined(
    bodies: Sequence[Body], pairs: _Pairs, groups: Sequence[Sequence[int]], source: str
) -> None:
    if not groups:
        return
    members = {i for group in groups for i in group}
    depth, i, j = max((depth, i, j) for (i, j), depth in pairs.items() if i in members)
    joined = "one body" if len(groups) == 1 else f"{len(groups)} bodies"
    _LOG.warning(
        f"{source}: {_count(members)} up to {depth:.3g} m deep inside each other "
        f"({bodies[i].name!r} in {bodies[j].name!r}); they move as {joined}; edit <pose> to "
        "separate the bodies"
    )


def _count(members: Collection[int]) -> str:
    return "1 movable body starts" if len(members) == 1 else f"{len(members)} movable bodies start"


def _join_bodies(bodies: Sequence[Body]) -> Body:
    """Join movable bodies into one, with the first body's name and the lowest body's friction."""
    inertias = []
    for body in bodies:
        mass = body.mass or 0.0
        tensor = np.diag(body.inertia or joint_moments(body.shapes, mass))
        inertias.append(Inertia(mass, body.pose, tensor))
    mass, pose, moments = combine_inertias(inertias)
    inverse = pose.inverse()
    shapes = tuple(
        replace(shape, pose=inverse @ body.pose @ shape.pose)
        for body in bodies
        for shape in body.shapes
    )
    bottoms = [lowest_point(body) for body in bodies]
    lowest = bodies[bottoms.index(min(bottoms))]
    return Body(bodies[0].name, pose, shapes, mass, lowest.friction, moments)


def _group_pairs(pairs: Iterable[tuple[int, int]]) -> list[list[int]]:
    groups: dict[int, list[int]] = {}
    for a, b in pairs:
        first, second = groups.setdefault(a, [a]), groups.setdefault(b, [b])
        if first is not second:
            first += second
            groups.update(dict.fromkeys(second, first))
    return [sorted(group) for group in {id(group): group for group in groups.values()}.values()]


def load_world(
    sdf: str,
    course: Course,
    model_paths: Sequence[str] = (),
    world_name: str = "",
    arguments: Mapping[str, object] | None = None,
    missing: str = "error",
    vehicles: str = "leave_out",
    mesh_up_axis: str = "ignore",
    actors: str = "walk",
    mesh_effort: float = 1.0,
) -> World:
    """Load the world of an SDF file, with ground below the course and without overlaps.

    ``sdf`` is a path, absolute or relative to the bundled folder ``worlds``, and ``arguments`` are
    passed to xacro. The other arguments are the fields of ``SdfOptions``. Messages name the world
    by its file, tables by its key in the configuration.
    """
    treatment = (missing, vehicles, mesh_up_axis, actors, float(mesh_effort))
    options = SdfOptions(tuple(model_paths), world_name, *treatment)
    world = read_world(sdf, options, arguments or {}, course)
    name = Path(sdf).name.partition(".")[0]
    bodies = free_bodies(settle(world.bodies, course, sdf), sdf)
    gravity, walking = world.gravity_mps2, world.actors
    return World(name, bodies, course, sdf, world.sha256, gravity_mps2=gravity, actors=walking)


def read_world(
    sdf: str, options: SdfOptions, arguments: Mapping[str, object], course: Course | None = None
) -> SdfWorld:
    """Read the bodies of an SDF file at the poses in the file; see ``load_world``."""
    path = find_file(sdf, "worlds")
    content, source = read_file(path), sdf
    if is_xacro(path, content):
        folders = options.model_paths
        xacro = ReadOptions(
            arguments=arguments, packages=folders, packages_key="world.NAME.model_paths"
        )
        text, absences = expand(path, xacro, index_packages(path, folders))
        absences.require_none(choose_instead(absences, xacro))
        content, source = text.encode(), f"{sdf} (expanded)"
    elif arguments:
        raise InputError(
            f"{sdf}: arguments {sorted(arguments)} cannot be used, because this file has no "
            f"xacro; remove them or name a .xacro file"
        )
    points = None
    if course is not None:
        corners = [course.home[:2], *course.waypoints]
        points = np.array([*corners, *points_between(corners)])
    world = read_sdf(content, source, options, path, points)
    return replace(world, bodies=drop_walls(world.bodies, sdf))
