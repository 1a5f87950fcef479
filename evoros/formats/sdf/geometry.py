"""The shapes of a collision in an SDF file."""

import math
from collections.abc import Callable, Mapping

from lxml import etree
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
_SIZES_M: Mapping[str, Mapping[str, tuple[float, ...]]] = {
    "box": {"size": (1.0, 1.0, 1.0)},
    "sphere": {"radius": (1.0,)},
    "cylinder": {"radius": (1.0,), "length": (1.0,)},
    "capsule": {"radius": (0.5,), "length": (1.0,)},
    "cone": {"radius": (0.5,), "length": (1.0,)},
    "ellipsoid": {"radii": (1.0, 1.0, 1.0)},
}
"""The lengths of each kind, with their defaults in SDF."""
_SIDES = 24  # of the polygons that stand for circles


def read_geometry(geometry: Element, reading: Reading) -> tuple[Shape, ...]:
    """Read the shapes of a ``<geometry>`` in its frame; none if it is empty or an image."""
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
    if kind == "plane":
        return _read_plane(solid)
    if kind not in _SIZES_M:
        problem = f"is not supported inside <{local_tag(geometry)}>"
        raise element_error(solid, problem, f"use {_KINDS}")
    sizes = _read_sizes(solid, reading)
    return _MAKERS[kind](*sizes) if kind in _MAKERS else (Shape(kind, sizes),)


def _read_sizes(solid: Element, reading: Reading) -> tuple[float, ...]:
    """Return the lengths [m] of a solid; without one of them, the default of SDF."""
    sizes: list[float] = []
    for tag, default in _SIZES_M[str(solid.tag)].items():
        element = find_child(solid, tag)
        if element is None:
            value = " ".join(f"{length:g}" for length in default)
            reading.notes.add(solid, f"has no <{tag}>: {value} m is assumed, the default of SDF")
        sizes += default if element is None else read_positive(element, len(default))
    return tuple(sizes)


def _read_plane(plane: Element) -> tuple[Shape, ...]:
    size, normal = find_child(plane, "size"), find_child(plane, "normal")
    if size is not None:  # only for its picture: a plane has no end
        read_numbers(size, 2)
    if normal is None:
        return (Shape("plane", (0.0, 0.0, 1.0)),)
    values = read_numbers(normal, 3)
    if sum(n * n for n in values) < 1e-12:
        raise element_error(normal, "must not be 0 0 0", "write 0 0 1 for level ground")
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
"""Make the shapes of what is no shape of its own here, from its sizes [m]."""


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
    scale = find_child(mesh, "scale")
    x, y, z = (1.0, 1.0, 1.0) if scale is None else _read_scale(scale)
    if x * y * z == 0:
        raise element_error(mesh, "must not have the scale 0", "write three lengths above 0")
    name, center = _read_submesh(find_child(mesh, "submesh"))
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
    return ("" if name is None else read_text(name), center is not None and read_flag(center))


def _read_scale(scale: Element) -> tuple[float, ...]:
    values = read_numbers(scale, 1, 3)
    return values * 3 if len(values) == 1 else values


def scale_model(model: Element, scale: Element, reading: Reading) -> None:
    """Apply the ``<scale>`` of a ``<state>`` to the sizes of a model's collisions.

    As in Gazebo, a mesh gets the scale in place of its own, and the poses of links and collisions
    stay.
    """
    x, y, z = _read_scale(scale)
    if (x, y, z) == (1.0, 1.0, 1.0):
        return
    if min(x, y, z) <= 0:
        raise element_error(scale, "must be greater than 0", "write three positive numbers")
    reading.notes.add(scale, f"scales the sizes of its shapes by {x:g} {y:g} {z:g}, as in Gazebo")
    factors: Mapping[str, tuple[float, ...]] = {
        "size": (x, y, z), "radii": (x, y, z), "radius": (max(x, y),), "length": (z,)
    }  # fmt: skip
    for solid in model.iterfind(".//collision/geometry/*"):
        for tag in _SIZES_M.get(str(solid.tag), ()):
            by = (max(x, y, z),) if solid.tag == "sphere" else factors[tag]
            for element in solid.findall(tag):
                sizes = read_numbers(element, len(by))
                element.text = " ".join(repr(a * b) for a, b in zip(sizes, by, strict=True))
        if solid.tag == "mesh":
            stated = solid.find("scale")
            element = etree.SubElement(solid, "scale") if stated is None else stated
            element.text = f"{x!r} {y!r} {z!r}"
