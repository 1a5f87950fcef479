"""Movable bodies that start in the ground or in other bodies.

An engine would push them out within a few steps, at any speed: a half-buried post of 1 m leaves the
ground at more than 10 m/s. So they are set on the surface or held together where they overlap, once
and before any engine, so that all simulators, pictures and files show the same world.
"""

import logging
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

import numpy as np

from evoros.formats.sdf.bodies import combine_inertias
from evoros.formats.sdf.inertial import Inertia
from evoros.geometry.footprint import bottom_height
from evoros.geometry.inertia import joint_moments
from evoros.geometry.overlap import overlap_depth
from evoros.geometry.shapes import Body
from evoros.world.floors import raise_body
from evoros.world.lifting import Lifts, find_lifts, find_sunk
from evoros.world.solids import SLACK_M, Solids

_LOG = logging.getLogger(__name__)

_Pairs = dict[tuple[int, int], float]
"""The depths [m] of the overlaps of pairs of bodies, of which the first is movable."""


def free_bodies(bodies: Sequence[Body], source: str) -> tuple[Body, ...]:
    """Return the bodies, of which no movable one starts in the ground or in another body.

    A body is lifted out of the ground and out of what carries it. Other movable bodies that overlap
    are joined to one body, and those that overlap a fixed body, or are stuck in the ground, are
    fixed: they stay at rest where they are. ``source`` names the world in messages.
    """
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
        if bodies[i].mass is None:
            continue
        for other in solids.list_near(shape, axes=3):
            j = int(solids.body[other])
            if bodies[j].mass is not None and j < i:
                continue
            depth = overlap_depth(solids.shapes[shape], solids.shapes[other])
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
        on_top = f", with {carried} on top" if carried else ""
        text = (
            f"{_count(depths)} in the ground or in a body below, at most by "
            f"{depths[deepest]:.3g} m ({bodies[deepest].name!r}); lifted to the surface{on_top}; "
            f"correct <pose> for another place"
        )
        _LOG.warning("%s: %s", source, text)


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
    text = (
        f"{_count(fixed)} in fixed bodies, or in bodies that do, at most by {depth:.3g} m "
        f"({bodies[deepest].name!r} in {other}); fixed in place, so that no robot pushes them; "
        f"correct <pose> to part the bodies"
    )
    _LOG.warning("%s: %s", source, text)


def _tell_joined(
    bodies: Sequence[Body], pairs: _Pairs, groups: Sequence[Sequence[int]], source: str
) -> None:
    if not groups:
        return
    members = {i for group in groups for i in group}
    depth, i, j = max((depth, i, j) for (i, j), depth in pairs.items() if i in members)
    joined = "one body" if len(groups) == 1 else f"{len(groups)} bodies"
    text = (
        f"{_count(members)} in one another, at most by {depth:.3g} m ({bodies[i].name!r} in "
        f"{bodies[j].name!r}); they move as {joined}; correct <pose> to part the bodies"
    )
    _LOG.warning("%s: %s", source, text)


def _count(members: Collection[int]) -> str:
    return "1 movable body starts" if len(members) == 1 else f"{len(members)} movable bodies start"


def _join_bodies(bodies: Sequence[Body]) -> Body:
    """Join movable bodies into one, named after the first.

    It has the friction of the body that reaches lowest, as a model of several links has.
    """
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
    bottoms = [min(bottom_height(s, body.pose @ s.pose) for s in body.shapes) for body in bodies]
    lowest = bodies[bottoms.index(min(bottoms))]
    return Body(bodies[0].name, pose, shapes, mass, lowest.friction, moments)


def _group_pairs(pairs: Iterable[tuple[int, int]]) -> list[list[int]]:
    """Return the groups of indices that pairs connect, each in ascending order."""
    groups: dict[int, list[int]] = {}
    for a, b in pairs:
        first, second = groups.setdefault(a, [a]), groups.setdefault(b, [b])
        if first is not second:
            first += second
            groups.update(dict.fromkeys(second, first))
    return [sorted(group) for group in {id(group): group for group in groups.values()}.values()]
