"""Reads the bodies in an SDF file (versions 1.0 to 1.12) with a ``<world>`` or only models.

The reader accepts all files that Gazebo accepts. No element that may matter is dropped silently:
omissions and assumptions are warnings of the logger ``evoros.sdf``. A ``<state>`` moves models and
links to world poses, as in Gazebo. Links connected by joints become one body. A link without a mass
has 1 kg, the default of SDF.
"""

import hashlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path as FilePath

import numpy as np
from lxml.etree import _Element as Element

from evoros.base.arrays import Array, principal_axes, product
from evoros.formats import strict_xml as xml
from evoros.formats.lenient_xml import parse_leniently
from evoros.formats.notes import Notes
from evoros.formats.sdf.actors import Actor, is_static, read_actors, settle_vehicles
from evoros.formats.sdf.elements import check_elements
from evoros.formats.sdf.frames import Frames, Path, read_pose
from evoros.formats.sdf.geometry import divide_meshes, scale_model
from evoros.formats.sdf.inclusion import drop_loose_joints, expand_includes, require_files
from evoros.formats.sdf.links import Inertia, Link, read_link
from evoros.formats.sdf.old_versions import modernize
from evoros.formats.sdf.reading import Reading, SdfOptions
from evoros.geometry.polyhedron import point_tensor
from evoros.geometry.shapes import Body, Pose, Vector


def build_fixed_bodies(links: Sequence[Link]) -> list[Body]:
    """Build a body for each collision of static links, so that each has its own friction."""
    solids = [(link.path, solid) for link in links for solid in link.solids]
    names = [path[0] if len(solids) == 1 else "::".join((*path, s.name)) for path, s in solids]
    return [
        Body(name, solid.pose, solid.shapes, friction=solid.friction)
        for name, (_, solid) in zip(names, solids, strict=True)
    ]


def build_movable_body(links: Sequence[Link], alone: bool, notes: Notes) -> list[Body]:
    """Build the body of links that move as one; none if it has no collisions.

    A body that is ``alone`` in its model may have the name of the model. If collisions differ in
    friction, the value of the lowest collision is used, because it touches the ground.
    """
    first = links[0]
    solids = [solid for link in links for solid in link.solids]
    if not solids:
        return []
    inertias = [link.inertia for link in links if link.inertia is not None]
    mass, pose, moments = combine_inertias(inertias)
    inverse = pose.inverse()
    shapes = tuple(
        replace(shape, pose=inverse @ solid.place(shape))
        for solid in solids
        for shape in solid.shapes
    )
    friction = solids[0].friction
    if any(solid.friction != friction for solid in solids):
        friction = min(solids, key=lambda solid: solid.bottom).friction
        values = ", ".join(f"{value:g}" for value in sorted({s.friction for s in solids}))
        problem = f"has collisions with friction {values}; the lowest collision's"
        notes.add(first.element, f"{problem} is used: {friction:g}", "frictions")
    name = first.path[0] if alone else "::".join(first.path)
    return [Body(name, pose, shapes, mass, friction, moments)]


def combine_inertias(parts: Sequence[Inertia]) -> tuple[float, Pose, Vector | None]:
    """Return the mass, principal frame in the world and principal moments of joined parts."""
    moments = parts[0].moments
    if len(parts) == 1 and moments is None:
        return parts[0].mass, parts[0].pose, None
    if len(parts) == 1 and moments is not None:
        diagonal = np.diag(moments)
        if not np.count_nonzero(moments - np.diag(diagonal)):
            return parts[0].mass, parts[0].pose, _to_vector(diagonal)
    masses = np.array([part.mass for part in parts])
    mass = float(masses.sum())
    centre = product(masses, np.array([part.pose.position for part in parts])) / mass
    total = np.zeros((3, 3))
    for part in parts:
        if part.moments is None:
            return mass, Pose(_to_vector(centre), parts[0].pose.quaternion), None
        rotation = part.pose.rotation
        total += product(product(rotation, part.moments), rotation.T)
        total += point_tensor(part.mass, np.array(part.pose.position) - centre)
    principal, axes = principal_axes(total)
    return mass, Pose.from_matrix(_to_vector(centre), axes), _to_vector(principal)


def _to_vector(values: Array) -> Vector:
    x, y, z = (float(value) for value in values)
    return (x, y, z)


_VERSIONS = "1.0 to 1.12"


@dataclass(frozen=True, eq=False)
class SdfWorld:
    """The content of an SDF file."""

    bodies: tuple[Body, ...]  # ordered as in the file
    gravity_mps2: float  # downwards
    actors: tuple[Actor, ...]
    sha256: str  # digest of all files read


def read_sdf(
    content: bytes,
    source: str,
    options: SdfOptions | None = None,
    file: FilePath | None = None,
    course: Array | None = None,
) -> SdfWorld:
    """Read the content of an SDF file, which errors call ``source``.

    Other files are near ``file``. Meshes near ``course`` (n, 2) [m] are divided first.
    """
    reading = Reading(file or FilePath(source).absolute(), options or SdfOptions(), source)
    root = parse_leniently(content, source)
    container = _choose_container(root, reading)
    _insert_and_delete(container)
    expand_includes(container, reading)
    drop_loose_joints(reading)
    left_out = settle_vehicles(container, reading)
    require_files(container, reading)
    check_elements(root, reading.notes)
    frames = Frames(container)
    for state in container.findall("state"):
        _apply_state(state, container, (), frames, reading, left_out)
    frames.check()
    models = container.findall("model")
    divide_meshes(_place_meshes(models, frames), course, reading)
    bodies = tuple(body for model in models for body in _build_bodies(model, frames, reading))
    gravity, actors = _read_gravity(container), read_actors(container, reading)
    reading.notes.report()
    return SdfWorld(bodies, gravity, actors, _hash(content, reading))


def _hash(content: bytes, reading: Reading) -> str:
    first = hashlib.sha256(content)
    if not reading.digests:
        return first.hexdigest()
    return hashlib.sha256(first.digest() + b"".join(sorted(reading.digests.values()))).hexdigest()


def _choose_container(root: Element, reading: Reading) -> Element:
    if root.tag not in ("sdf", "gazebo"):
        raise xml.element_error(root, "must be <sdf>", f"give an SDF file, version {_VERSIONS}")
    version = re.fullmatch(r"1\.([0-9]{1,2})", root.get("version", "").strip())
    if version is None or int(version[1]) > 12:
        problem = f"must have a version from {_VERSIONS}, not {xml.quote(root.get('version', ''))}"
        raise xml.element_error(root, problem, "convert the file")
    modernize(root, reading.notes)
    worlds = root.findall("world")
    wanted = reading.options.world_name
    names = [world.get("name", "") for world in worlds]
    listed = ", ".join(map(xml.quote, names)) or "none"
    fix = f"type world.NAME.world_name=WORLD, where WORLD is one of: {listed}"
    if wanted and wanted not in names:
        raise xml.element_error(root, f"has no world {xml.quote(wanted)}", fix)
    if wanted:
        worlds = [worlds[names.index(wanted)]]
    if len(worlds) > 1:
        raise xml.element_error(worlds[1], f"is one of {len(worlds)} worlds in the file", fix)
    if not worlds:
        return root
    for other in [child for child in root if child is not worlds[0]]:
        if other.tag in ("model", "include"):
            reading.notes.add(other, "is left out: it is outside the world", "beside")
        if other.tag in ("model", "include", "world"):
            root.remove(other)
    return worlds[0]


def _insert_and_delete(container: Element) -> None:
    for state in container.findall("state"):
        for change in state.findall("insertions"):
            container.extend(change.findall("model"))
            state.remove(change)
        for change in state.findall("deletions"):
            names = {(name.text or "").strip() for name in change.findall("name")}
            for model in [*container.iterchildren("model", "include")]:
                if (model.get("name") or model.findtext("name") or "").strip() in names:
                    container.remove(model)
            state.remove(change)


def _read_gravity(container: Element) -> float:
    for parent in (container, *container.findall("physics")):
        gravity = xml.find_child(parent, "gravity")
        if gravity is not None:
            x, y, z = xml.read_numbers(gravity, 3)
            if max(abs(x), abs(y)) > 0.05 or z >= -0.05:
                reason = "evoros supports only robots that drive on the ground"
                problem = f"must point straight down, not along {x:g} {y:g} {z:g}: {reason}"
                raise xml.element_error(gravity, problem, "write a value such as 0 0 -9.81")
            return -z
    return 9.81


def _apply_state(
    state: Element,
    owner: Element,
    scope: Path,
    frames: Frames,
    reading: Reading,
    left_out: set[str],
) -> None:
    for element in state.iterchildren("model", "link"):
        name = xml.read_name(element)
        if not scope and name in left_out:
            continue
        path = (*scope, name)
        inner = next((m for m in owner.findall(str(element.tag)) if m.get("name") == name), None)
        scale = xml.find_child(element, "scale")
        if scale is not None and inner is not None:
            scale_model(inner, scale, reading)
        relative = read_pose(element)
        if relative.base not in ("", "world"):
            problem = f"must not be relative to {xml.quote(relative.base)}"
            raise xml.element_error(relative.element, problem, "give the pose in the world frame")
        has_pose = relative.element is not element
        if has_pose and not frames.move(path, relative.pose):
            problem = "is ignored: nothing in the world has this name"
            reading.notes.add(element, problem, "state")
        elif element.tag == "model" and inner is not None:
            _apply_state(element, inner, path, frames, reading, left_out)


def _place_meshes(models: Sequence[Element], frames: Frames) -> Iterator[tuple[Element, Pose]]:
    for model in models:
        for path, element, _ in _walk_models(model, (), False):
            for link in element.findall("link"):
                for collision in link.findall("collision"):
                    mesh = collision.find("geometry/mesh")
                    if mesh is not None and not xml.touches_nothing(collision):
                        yield mesh, frames.resolve(collision, (*path, xml.read_name(link)))


def _build_bodies(model: Element, frames: Frames, reading: Reading) -> list[Body]:
    """Build the bodies of a top-level model; links connected by joints form one body."""
    links: list[Link] = []
    parents: dict[Path, Path] = {}  # each link's link that represents its body; (): the ground
    models = list(_walk_models(model, (), False))
    for path, element, static in models:
        for child in element.findall("link"):
            link = read_link(child, (*path, xml.read_name(child)), frames, static, reading)
            links.append(link)
            parents[link.path] = () if static or link.held else link.path
    for path, element, static in models:
        # joints do not move links of static models
        for joint in () if static else element.findall("joint"):
            _join(joint, path, frames, parents)
    groups: dict[Path, list[Link]] = {}
    for link in links:
        groups.setdefault(_find_root(parents, link.path), []).append(link)
    bodies = build_fixed_bodies(groups.pop((), []))
    for group in groups.values():
        alone = len(groups) == 1 and not bodies
        bodies += build_movable_body(group, alone, reading.notes)
    return bodies


def _walk_models(model: Element, scope: Path, static: bool) -> Iterator[tuple[Path, Element, bool]]:
    static = static or is_static(model)
    path = (*scope, xml.read_name(model))
    yield path, model, static
    for child in model.findall("model"):
        yield from _walk_models(child, path, static)


def _join(joint: Element, scope: Path, frames: Frames, parents: dict[Path, Path]) -> None:
    roots = []
    for tag in ("parent", "child"):
        end = xml.require_child(joint, tag)
        name = xml.read_text(end)
        # a link joined to the world is fixed to the ground
        path = () if name == "world" else frames.find(scope, name, end)
        if path and path not in parents:
            raise xml.element_error(
                end, f"names {xml.quote(name)}, which is not a link", "name a link"
            )
        roots.append(_find_root(parents, path))
    # keep the ground, (), at the end of the chain
    first, last = roots if roots[0] else roots[::-1]
    if first:
        parents[first] = last


def _find_root(parents: dict[Path, Path], path: Path) -> Path:
    while path and parents[path] != path:
        path = parents[path]
    return path
