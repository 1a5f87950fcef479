"""The shapes of a collision in an SDF file."""

import math

from lxml.etree import _Element as Element

from evoros.base import elementary
from evoros.base.errors import InputError
from evoros.formats.mesh import read_mesh
from evoros.formats.missing import MissingFileError
from evoros.formats.sdf.heightmap import read_heightmap
from evoros.formats.sdf.named_files import CHOICES, find_uri, require_file
from evoros.formats.sdf.reading import Reading
from evoros.formats.strict_xml import (
    element_error,
    find_child,
    local_tag,
    read_flag,
    read_numbers,
    read_positive,
    read_text,
)
from evoros.geometry.decomposition import decompose
from evoros.geometry.shapes import Pose, Shape, Vector

_KINDS = (
    "box, capsule, cone, cylinder, ellipsoid, empty, heightmap, mesh, plane, polyline or sphere"
)
_SIDES = 24  # of the polygons that stand for circles


def read_geometry(geometry: Element, reading: Reading) -> tuple[Shape, ...]:
    """Read the shapes of a ``<geometry>`` in its frame; none if it is empty or an image.

    Raises:
        InputError: the geometry cannot be read.
    """
    solids = [child for child in geometry if not child.prefix]
    kinds = {str(child.tag) for child in solids}
    if not solids or (len(solids) > 1 and kinds != {"polyline"}):
        element = solids[1] if solids else geometry
        problem = f"makes {len(solids)} shapes in one <geometry>, not one"
        raise element_error(element, problem, "write one <collision> for each shape")
    solid = solids[0]
    kind = str(solid.tag)
    if kind == "empty":
        return ()
    if kind == "image":
        reading.notes.add(solid, "is left out: no simulator here makes walls of an image")
        return ()
    if kind == "polyline":
        return _read_polylines(solids)
    if kind == "mesh":
        return _read_mesh(solid, reading)
    if kind == "heightmap":
        return (read_heightmap(solid, reading),)
    if kind not in _PRIMITIVES:
        problem = f"is not supported inside <{local_tag(geometry)}>"
        raise element_error(solid, problem, f"use {_KINDS}")
    return _PRIMITIVES[kind](solid, reading)


def _read_lengths(
    solid: Element, tag: str, reading: Reading, default: tuple[float, ...]
) -> tuple[float, ...]:
    """Return the lengths [m] in a child of a solid; without it, the default of SDF."""
    element = find_child(solid, tag)
    if element is not None:
        return read_positive(element, len(default))
    value = " ".join(f"{length:g}" for length in default)
    reading.notes.add(solid, f"has no <{tag}>: {value} m is assumed, the default of SDF")
    return default


def _read_box(box: Element, reading: Reading) -> tuple[Shape, ...]:
    return (Shape("box", _read_lengths(box, "size", reading, (1.0, 1.0, 1.0))),)


def _read_sphere(sphere: Element, reading: Reading) -> tuple[Shape, ...]:
    return (Shape("sphere", _read_lengths(sphere, "radius", reading, (1.0,))),)


def _read_cylinder(cylinder: Element, reading: Reading) -> tuple[Shape, ...]:
    return (Shape("cylinder", _read_radius_and_length(cylinder, reading, 1.0)),)


def _read_radius_and_length(
    element: Element, reading: Reading, radius_m: float
) -> tuple[float, float]:
    (radius,) = _read_lengths(element, "radius", reading, (radius_m,))
    (length,) = _read_lengths(element, "length", reading, (1.0,))
    return radius, length


def _read_plane(plane: Element, reading: Reading) -> tuple[Shape, ...]:
    size, normal = find_child(plane, "size"), find_child(plane, "normal")
    if size is not None:  # only for its picture: a plane has no end
        read_numbers(size, 2)
    if normal is None:
        return (Shape("plane", (0.0, 0.0, 1.0)),)
    values = read_numbers(normal, 3)
    if sum(n * n for n in values) < 1e-12:
        raise element_error(normal, "must not be 0 0 0", "write 0 0 1 for level ground")
    return (Shape("plane", values),)


def _read_capsule(capsule: Element, reading: Reading) -> tuple[Shape, ...]:
    radius, length = _read_radius_and_length(capsule, reading, 0.5)
    ends = (Shape("sphere", (radius,), Pose((0.0, 0.0, z))) for z in (-length / 2, length / 2))
    return (Shape("cylinder", (radius, length)), *ends)


def _read_ellipsoid(ellipsoid: Element, reading: Reading) -> tuple[Shape, ...]:
    a, b, c = _read_lengths(ellipsoid, "radii", reading, (1.0, 1.0, 1.0))
    corners: list[Vector] = [(0.0, 0.0, -c), (0.0, 0.0, c)]
    for i in range(1, _SIDES // 2):
        latitude = math.pi * (i / (_SIDES // 2) - 0.5)
        for x, y in _circle():
            radius = elementary.cos(latitude)
            corners.append((a * radius * x, b * radius * y, c * elementary.sin(latitude)))
    return (Shape("convex", (), corners=tuple(corners)),)


def _read_cone(cone: Element, reading: Reading) -> tuple[Shape, ...]:
    radius, length = _read_radius_and_length(cone, reading, 0.5)
    base = [(radius * x, radius * y, -length / 2) for x, y in _circle()]
    return (Shape("convex", (), corners=((0.0, 0.0, length / 2), *base)),)


def _circle() -> list[tuple[float, float]]:
    angles = (2 * math.pi * i / _SIDES for i in range(_SIDES))
    return [(elementary.cos(angle), elementary.sin(angle)) for angle in angles]


_PRIMITIVES = {
    "box": _read_box,
    "sphere": _read_sphere,
    "cylinder": _read_cylinder,
    "plane": _read_plane,
    "capsule": _read_capsule,
    "ellipsoid": _read_ellipsoid,
    "cone": _read_cone,
}


def _read_polylines(polylines: list[Element]) -> tuple[Shape, ...]:
    """Read prisms that stand on z = 0; a polyline inside another one is a hole in it."""
    rings = []
    for polyline in polylines:
        points = [read_numbers(point, 2) for point in polyline.findall("point")]
        if len(points) < 3:
            problem = f"must have three or more <point>, not {len(points)}"
            raise element_error(polyline, problem, "add points")
        rings.append([(point[0], point[1]) for point in points])
    element = find_child(polylines[0], "height")
    height = 1.0 if element is None else read_positive(element, 1)[0]
    try:
        pieces = decompose(rings)
    except ValueError as error:
        problem = f"must be a simple polygon, but {error}"
        raise element_error(polylines[0], problem, "correct its points") from None
    return tuple(
        Shape("convex", (), corners=tuple((x, y, z) for x, y in piece for z in (0.0, height)))
        for piece in pieces
    )


def _read_mesh(mesh: Element, reading: Reading) -> tuple[Shape, ...]:
    element = find_uri(mesh)
    if element is None:
        raise element_error(mesh, "must have a <uri>", "name a mesh file")
    scale_element = find_child(mesh, "scale")
    scale = (1.0, 1.0, 1.0) if scale_element is None else read_numbers(scale_element, 1, 3)
    x, y, z = scale * 3 if len(scale) == 1 else scale
    if x * y * z == 0:
        raise element_error(mesh, "must not have the scale 0", "write three lengths above 0")
    submesh = find_child(mesh, "submesh")
    name, center = _read_submesh(submesh)
    place = require_file(element, reading)
    reading.read(place)
    try:
        up_axis = reading.options.mesh_up_axis == "apply"
        mesh_shapes = read_mesh(place.resolve(), (x, y, z), name, center, up_axis)
    except InputError as error:
        problem = f"names a mesh that cannot be read: {error}"
        raise MissingFileError(str(element_error(element, problem, f"or {CHOICES}"))) from None
    for note in mesh_shapes.notes:
        reading.notes.add_file(place.resolve(), note)
    return mesh_shapes.shapes


def _read_submesh(submesh: Element | None) -> tuple[str, bool]:
    if submesh is None:
        return "", False
    name, center = find_child(submesh, "name"), find_child(submesh, "center")
    return (
        "" if name is None else read_text(name),
        center is not None and read_flag(center),
    )
