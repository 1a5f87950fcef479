"""The shapes of a collision in an SDF file."""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import replace
from itertools import product

import numpy as np
from lxml import etree
from lxml.etree import _Element as Element

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.formats import strict_xml as xml
from evoros.formats.mesh import Mesh, find_box, read_mesh
from evoros.formats.missing import MissingFileError
from evoros.formats.sdf.heightmaps import read_heightmap
from evoros.formats.sdf.inclusion import CHOICES, find_uri, require_file
from evoros.formats.sdf.reading import Reading
from evoros.geometry.polyhedron import decompose, placed_corners
from evoros.geometry.shapes import MeshFile, Pose, Shape, Vector
from evoros.terminal.activity import announce

_MINUTE = 1.4e7  # work on meshes (see ``divide_mesh``) that takes a minute, with further handling
_MOST_WORK = 2e6  # maximum work on one mesh; most buildings need less
REACH_M = 30.0  # distance [m] from the course beyond which meshes stay coarse; grows with effort
HIGH_M = 0.6  # height [m] above which few robots reach or see


_KINDS = (
    "box, capsule, cone, cylinder, ellipsoid, empty, heightmap, mesh, plane, polyline or sphere"
)
_SIZES_M: Mapping[str, Mapping[str, tuple[float, ...]]] = {
    "box": {"size": (1.0, 1.0, 1.0)},
    "sphere": {"radius": (1.0,)},
    "cylinder": {"radius": (1.0,), "length": (1.0,)},
    "capsule": {"radius": (0.5,), "length": (1.0,)},
    "cone": {"radius": (0.5,), "length": (1.0,)},
    "ellipsoid": {"radii": (1.0, 1.0, 1.0)},
}
"""Lengths of each kind of solid, with SDF's defaults."""
_SIDES = 24  # number of sides of the polygons that replace circles


def read_geometry(geometry: Element, reading: Reading) -> tuple[Shape, ...]:
    """Read the shapes of a ``<geometry>`` in its frame; none if it is empty or an image."""
    solids = [child for child in geometry if not child.prefix]
    kinds = {str(child.tag) for child in solids}
    if not solids:
        raise xml.element_error(geometry, "must contain a shape", "add a shape, such as <box>")
    if len(solids) > 1 and kinds != {"polyline"}:
        problem = f"must be the only shape in <geometry>, which has {len(solids)}"
        raise xml.element_error(solids[1], problem, "write one <collision> for each shape")
    solid, kind = solids[0], str(solids[0].tag)
    if kind == "empty":
        return ()
    if kind == "image":
        reading.notes.add(solid, "is left out: evoros does not build walls from images")
        return ()
    if kind == "polyline":
        return _read_polylines(solids)
    if kind == "mesh":
        return _read_mesh(solid, reading)
    if kind == "heightmap":
        return (read_heightmap(solid, reading),)
    if kind == "plane":
        return _read_plane(solid)
    if kind not in _SIZES_M:
        problem = f"is not supported inside <{xml.local_tag(geometry)}>"
        raise xml.element_error(solid, problem, f"use {_KINDS}")
    sizes = _read_sizes(solid, reading)
    return _MAKERS[kind](*sizes) if kind in _MAKERS else (Shape(kind, sizes),)


def _read_sizes(solid: Element, reading: Reading) -> tuple[float, ...]:
    sizes: list[float] = []
    for tag, default in _SIZES_M[str(solid.tag)].items():
        element = xml.find_child(solid, tag)
        if element is None:
            value = " ".join(f"{length:g}" for length in default)
            reading.notes.add(solid, f"has no <{tag}>: SDF's default of {value} m is assumed")
        sizes += default if element is None else xml.read_positive(element, len(default))
    return tuple(sizes)


def _read_plane(plane: Element) -> tuple[Shape, ...]:
    size, normal = xml.find_child(plane, "size"), xml.find_child(plane, "normal")
    if size is not None:  # affects only the drawing of the unbounded plane
        xml.read_numbers(size, 2)
    if normal is None:
        return (Shape("plane", (0.0, 0.0, 1.0)),)
    values = xml.read_numbers(normal, 3)
    if sum(n * n for n in values) < 1e-12:
        raise xml.element_error(normal, "must not be 0 0 0", "write 0 0 1 for level ground")
    return (Shape("plane", values),)


def _make_capsule(radius: float, length: float) -> tuple[Shape, ...]:
    ends = (Shape("sphere", (radius,), Pose((0.0, 0.0, z))) for z in (-length / 2, length / 2))
    return (Shape("cylinder", (radius, length)), *ends)


def _make_ellipsoid(a: float, b: float, c: float) -> tuple[Shape, ...]:
    corners: list[Vector] = [(0.0, 0.0, -c), (0.0, 0.0, c)]
    for i in range(1, _SIDES // 2):
        latitude = math.pi * (i / (_SIDES // 2) - 0.5)
        for x, y in _circle():
            radius = elementary.cos(latitude)
            corners.append((a * radius * x, b * radius * y, c * elementary.sin(latitude)))
    return (Shape("convex", (), corners=tuple(corners)),)


def _make_cone(radius: float, length: float) -> tuple[Shape, ...]:
    base = [(radius * x, radius * y, -length / 2) for x, y in _circle()]
    return (Shape("convex", (), corners=((0.0, 0.0, length / 2), *base)),)


def _circle() -> list[tuple[float, float]]:
    angles = (2 * math.pi * i / _SIDES for i in range(_SIDES))
    return [(elementary.cos(angle), elementary.sin(angle)) for angle in angles]


_MAKERS: Mapping[str, Callable[..., tuple[Shape, ...]]] = {
    "capsule": _make_capsule,
    "ellipsoid": _make_ellipsoid,
    "cone": _make_cone,
}
"""Functions that build a solid of each kind from its lengths [m]."""


def _read_polylines(polylines: list[Element]) -> tuple[Shape, ...]:
    """Read prisms that stand on z = 0; a polyline inside another polyline is a hole."""
    rings: list[list[tuple[float, float]]] = []
    for polyline in polylines:
        points = (xml.read_numbers(point, 2) for point in polyline.findall("point"))
        rings.append([(x, y) for x, y in points])
        if len(rings[-1]) < 3:
            problem = f"must have three or more <point>, not {len(rings[-1])}"
            raise xml.element_error(polyline, problem, "add points")
    element = xml.find_child(polylines[0], "height")
    height = 1.0 if element is None else xml.read_positive(element, 1)[0]
    try:
        pieces = decompose(rings)
    except ValueError as error:
        problem = f"must be a simple polygon, but {error}"
        raise xml.element_error(polylines[0], problem, "move its points") from None
    return tuple(
        Shape("convex", (), corners=tuple((x, y, z) for x, y in piece for z in (0.0, height)))
        for piece in pieces
    )


def _read_mesh(mesh: Element, reading: Reading) -> tuple[Shape, ...]:
    use = _identify_mesh(mesh, reading)
    if 0.0 in use.scale:
        reading.notes.add(
            mesh, "is left out: a mesh with a scale of 0 is flat, so nothing can touch it"
        )
        return ()
    if use not in reading.meshes:
        reading.meshes[use] = _read_parts(mesh, use, 0.0).shapes
    return reading.meshes[use]


def _identify_mesh(mesh: Element, reading: Reading) -> MeshFile:
    element = find_uri(mesh)
    if element is None:
        raise xml.element_error(mesh, "must have a <uri>", "name a mesh file")
    scale = xml.find_child(mesh, "scale")
    x, y, z = (1.0, 1.0, 1.0) if scale is None else _read_scale(scale)
    name, center = _read_submesh(xml.find_child(mesh, "submesh"))
    place = require_file(element, reading).resolve()
    if place not in reading.digests:
        reading.read(place)
    turn = reading.options.mesh_up_axis == "apply"
    return MeshFile(place, (x, y, z), name, center, turn)


def _read_parts(mesh: Element, file: MeshFile, work: float, uses: int = 1) -> Mesh:
    try:
        return read_mesh(file, work, uses)
    except InputError as error:
        problem = f"names a mesh that cannot be read: {error}"
        element = find_uri(mesh)
        assert element is not None
        raise MissingFileError(str(xml.element_error(element, problem, f"or {CHOICES}"))) from None


def divide_meshes(
    placed: Iterable[tuple[Element, Pose]], course: Array | None, reading: Reading
) -> None:
    """Divide meshes at their world poses into convex parts, nearest to the ``course`` first.

    ``course`` is (n, 2) [m]; without it, distances are from the origin, and all meshes are in
    reach. Meshes above ``HIGH_M``, such as items on desks, come last. A mesh keeps its coarse parts
    if these fit well, if the mesh is out of reach of the course, or once the effort for the world
    is spent. Each use of a mesh adds work for handling its parts.
    """
    effort = reading.options.mesh_effort
    reach = math.inf if course is None else REACH_M * max(effort, 1.0)
    points = np.zeros((1, 2)) if course is None else course
    uses = _list_uses(placed, points, reach, reading)
    left = effort * _MINUTE
    for index, (use, mesh, (is_far, _, distance, _), count) in enumerate(uses, 1):
        # Halve the work until it is within the limit, because parts are cached for each amount.
        limits = (effort * _MOST_WORK / 2**i for i in range(7))
        wanted, work = 10 * effort, next((limit for limit in limits if limit <= left), 0.0)
        remark = "the mesh is divided coarsely to save time"
        if is_far:
            wanted, work = max(wanted, math.ceil(distance / REACH_M)), 0.0
            remark = (
                f"the mesh is divided coarsely, because it is more than {reach:g} m from the course"
            )
        text = f"dividing {use.path.name} into convex parts, mesh {index} of {len(uses)}"
        with suppress(InputError), announce(text):
            parts = _read_parts(mesh, use, work, count)
            left -= parts.work
            reading.meshes[use] = parts.shapes
            for note in parts.remarks:
                reading.notes.add_file(use.path, note)
            if parts.is_cut_short:
                more = f"world.NAME.mesh_effort={wanted:g} makes finer parts, but takes longer"
                reading.notes.add_file(use.path, f"{remark}; {more}")
            if parts.is_cut_short and is_far:
                reading.meshes[use] = tuple(replace(shape, mesh=None) for shape in parts.shapes)


Place = tuple[bool, bool, float, float]
"""The order of a mesh: out of reach last, high later, then by distance and height [m]."""


def _list_uses(
    placed: Iterable[tuple[Element, Pose]], points: Array, reach: float, reading: Reading
) -> list[tuple[MeshFile, Element, Place, int]]:
    """List each mesh once, with its nearest place and its number of uses, nearest first."""
    boxes: dict[MeshFile, Array] = {}
    places: dict[MeshFile, Place] = {}
    uses: Counter[MeshFile] = Counter()
    elements: dict[MeshFile, Element] = {}
    for mesh, pose in placed:
        with suppress(InputError):  # reading the body later raises the error or omits the mesh
            use = _identify_mesh(mesh, reading)
            if 0.0 in use.scale:
                continue
            if use not in boxes:
                with announce(f"reading {use.path.name}, mesh {len(boxes) + 1}"):
                    boxes[use] = np.array([*product(*find_box(use).T)])
            place = _measure_place(boxes[use], pose, points, reach)
            uses[use] += 1
            elements[use], places[use] = mesh, min(place, places.get(use, place))
    ordered = sorted(places, key=places.__getitem__)
    return [(use, elements[use], places[use], uses[use]) for use in ordered]


def _measure_place(corners: Array, pose: Pose, points: Array, reach: float) -> Place:
    corners = placed_corners(corners, pose.rotation, pose.position)
    low, high = corners.min(axis=0), corners.max(axis=0)
    gaps = np.maximum(np.maximum(low[:2] - points, points - high[:2]), 0.0)
    distance = float(np.sqrt((gaps * gaps).sum(axis=1)).min())
    return distance > reach, bool(low[2] > HIGH_M), distance, float(low[2])


def _read_submesh(submesh: Element | None) -> tuple[str, bool]:
    if submesh is None:
        return "", False
    name, center = xml.find_child(submesh, "name"), xml.find_child(submesh, "center")
    return (
        "" if name is None else xml.read_text(name),
        center is not None and xml.read_flag(center),
    )


def _read_scale(scale: Element) -> tuple[float, ...]:
    values = xml.read_numbers(scale, 1, 3)
    return values * 3 if len(values) == 1 else values


def scale_model(model: Element, scale: Element, reading: Reading) -> None:
    """Apply a state's ``<scale>`` to a model's sizes, not to its poses; meshes lose their scale."""
    x, y, z = _read_scale(scale)
    if (x, y, z) == (1.0, 1.0, 1.0):
        return
    if min(x, y, z) <= 0:
        raise xml.element_error(scale, "must be greater than 0", "write three positive numbers")
    reading.notes.add(scale, f"scales only the sizes of shapes, by {x:g} {y:g} {z:g}, as in Gazebo")
    factors: Mapping[str, tuple[float, ...]] = {
        "size": (x, y, z), "radii": (x, y, z), "radius": (max(x, y),), "length": (z,)
    }  # fmt: skip
    for solid in model.iterfind(".//collision/geometry/*"):
        for tag in _SIZES_M.get(str(solid.tag), ()):
            by = (max(x, y, z),) if solid.tag == "sphere" else factors[tag]
            for element in solid.findall(tag):
                sizes = xml.read_numbers(element, len(by))
                element.text = " ".join(repr(a * b) for a, b in zip(sizes, by, strict=True))
        if solid.tag == "mesh":
            stated = solid.find("scale")
            element = etree.SubElement(solid, "scale") if stated is None else stated
            element.text = f"{x!r} {y!r} {z!r}"
