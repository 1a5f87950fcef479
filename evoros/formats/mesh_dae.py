"""Reads the surfaces of a COLLADA file (DAE), with its unit and the poses of its scene.

As in Gazebo Classic and RViz, ``<up_axis>`` is ignored by default, because some exporters always
write ``Y_UP``. ``pycollada`` rejects more public files than this reader.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from math import radians
from pathlib import Path

import numpy as np
from lxml import etree
from lxml.etree import _Element as Element

from evoros.base import elementary
from evoros.base.arrays import Array, determinant, length, product
from evoros.base.errors import InputError
from evoros.formats.strict_xml import shorten

_DEEPEST = 100  # maximum nesting depth of nodes; deeper nesting is taken for a cycle of references


@dataclass(frozen=True, eq=False)
class Submesh:
    """A named part of a mesh file, as triangles."""

    names: tuple[str, ...]  # names that select the submesh
    triangles: Array  # (n, 3, 3) [m]: triangle, corner, axis
    colours: Array  # (n, 3): red, green, blue, 0 to 1; NaN if the file has no colours


_UPRIGHT = {
    "X_UP": ((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)),
    "Y_UP": ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0)),
}
"""Rotations from the axes of a file to x right, z up; COLLADA names the axes right, up and in."""


def read_dae(path: Path, up_axis: bool = False) -> list[Submesh]:
    """Read all surfaces of the scene [m]; ``up_axis`` applies the file's ``<up_axis>``."""
    # Some programs write < and & into attributes, so ignore such errors.
    parser = etree.XMLParser(huge_tree=True, resolve_entities=False, no_network=True, recover=True)
    try:
        root = etree.parse(path, parser).getroot()
        if root is None or etree.QName(root).localname != "COLLADA":
            raise ValueError("there is no <COLLADA>")
        with np.errstate(all="ignore"):  # invisible objects may have invalid poses
            return list(_Document(root).surfaces(up_axis))
    except (etree.XMLSyntaxError, ValueError, LookupError, OverflowError, RecursionError) as error:
        problem = f"must be a COLLADA file ({shorten(error)})"
        raise InputError(f"{path}: {problem}; export it again, or export it as STL") from error


class _Document:
    def __init__(self, root: Element) -> None:
        self.root = root
        # Exporters may give a node the id of its scene or geometry, so an id alone is not unique.
        self.by_id = {
            (etree.QName(element).localname, element.get("id")): element
            for element in root.iter("{*}*")
            if element.get("id")
        }

    def surfaces(self, up_axis: bool) -> Iterator[Submesh]:
        unit = self.root.find("{*}asset/{*}unit")
        meter = float(unit.get("meter", "1")) if unit is not None else 1.0
        base = np.diag([meter, meter, meter, 1.0])
        axis = (self.root.findtext("{*}asset/{*}up_axis") or "Y_UP").strip()  # Y_UP is the default
        if up_axis and axis in _UPRIGHT:
            base[:3, :3] = meter * np.array(_UPRIGHT[axis])
        shown = self.root.find("{*}scene/{*}instance_visual_scene")
        if shown is None:
            for geometry in self.root.iterfind("{*}library_geometries/{*}geometry"):
                yield self._surface(geometry, base, (), None)
            return
        for node in self._target(shown, "visual_scene").iterfind("{*}node"):
            yield from self._node(node, base, 0)

    def _target(self, element: Element, tag: str) -> Element:
        address = element.get("url") or element.get("source") or ""
        target = self.by_id.get((tag, address.removeprefix("#")))
        if target is None:
            raise ValueError(f"line {element.sourceline}: there is no <{tag}> {address!r}")
        return target

    def _node(self, node: Element, pose: Array, depth: int) -> Iterator[Submesh]:
        if depth > _DEEPEST:
            raise ValueError(f"nodes are nested more than {_DEEPEST} deep, perhaps in a cycle")
        pose = pose @ _transform(node)
        names = _names_of(node)
        for child in node.iterfind("{*}*"):
            tag = etree.QName(child).localname
            if tag == "node":
                yield from self._node(child, pose, depth + 1)
            elif tag == "instance_node":
                yield from self._node(self._target(child, "node"), pose, depth + 1)
            elif tag == "instance_geometry":
                yield self._surface(self._target(child, "geometry"), pose, names, child)
            elif tag == "instance_controller":
                skin = self._target(child, "controller").find("{*}skin")
                if skin is not None:
                    yield self._surface(self._target(skin, "geometry"), pose, names, child)

    def _surface(
        self, geometry: Element, pose: Array, names: tuple[str, ...], instance: Element | None
    ) -> Submesh:
        pieces, colours = [np.empty((0, 3, 3))], [np.empty((0, 3))]
        for element in geometry.iterfind("{*}mesh/{*}*"):
            colour = self._find_colour(element.get("material", ""), instance)
            for piece in self._triangles(element):
                pieces.append(piece)
                colours.append(np.tile(colour, (len(piece), 1)))
        triangles = product(np.concatenate(pieces), pose[:3, :3].T) + pose[:3, 3]
        if determinant(pose[:3, :3]) < 0:
            triangles = triangles[:, ::-1]  # mirrored: faces would point inwards
        return Submesh((*names, *_names_of(geometry)), triangles, np.concatenate(colours))

    def _find_colour(self, symbol: str, instance: Element | None) -> Array:
        """Return the diffuse colour (3,) of a material; NaN if it has no single colour."""
        bound = [] if instance is None else instance.iterfind(".//{*}instance_material")
        names = [str(e.get("target")) for e in bound if e.get("symbol") == symbol]
        material = self.by_id.get(("material", (names or [symbol])[0].removeprefix("#")))
        effect = None if material is None else material.find("{*}instance_effect")
        address = "" if effect is None else str(effect.get("url")).removeprefix("#")
        shader = self.by_id.get(("effect", address))
        text = None if shader is None else shader.findtext(".//{*}diffuse/{*}color")
        with suppress(ValueError):  # an invalid colour is no reason to reject a mesh
            values = np.array((text or "").split(), dtype=np.float64)
            if len(values) >= 3 and np.isfinite(values).all():
                return values[:3].clip(0.0, 1.0)
        return np.full(3, np.nan)

    def _triangles(self, element: Element) -> Iterator[Array]:
        """Yield arrays (n, 3, 3) of the triangles in one list of primitives."""
        corners = _CORNERS.get(etree.QName(element).localname)
        inputs = list(element.iterfind("{*}input"))
        if corners is None or not inputs:
            return
        stride = 1 + max(int(entry.get("offset", "0")) for entry in inputs)
        vertex = _find_input(inputs, "VERTEX")
        points = self._points(self._target(vertex, "vertices"))
        for indices in element.iterfind("{*}p"):
            flat = _numbers(indices, np.int64)[int(vertex.get("offset", "0")) :: stride]
            counts = element.find("{*}vcount")
            triples = corners(flat, None if counts is None else _numbers(counts, np.int64))
            yield points[triples]

    def _points(self, vertices: Element) -> Array:
        position = _find_input(vertices.iterfind("{*}input"), "POSITION")
        source = self._target(position, "source")
        values = source.find("{*}float_array")
        if values is None:
            raise ValueError(f"source {source.get('id')!r} has no float_array")
        accessor = source.find("{*}technique_common/{*}accessor")
        stride = int(accessor.get("stride", "3")) if accessor is not None else 3
        return _numbers(values, np.float64).reshape(-1, stride)[:, :3]


def _find_input(inputs: Iterable[Element], semantic: str) -> Element:
    entry = next((entry for entry in inputs if entry.get("semantic") == semantic), None)
    if entry is None:
        raise ValueError(f"there is no <input> with semantic {semantic}")
    return entry


def _names_of(element: Element) -> tuple[str, ...]:
    return tuple(name for key in ("name", "id") if (name := element.get(key)))


def _numbers(element: Element, kind: type) -> Array:
    return np.asarray(np.array((element.text or "").split(), dtype=kind))


def _fan(flat: Array, counts: Array | None) -> Array:
    """Return the triangles of polygons with ``counts`` corners each; None for a single polygon."""
    if counts is None:
        counts = np.array([len(flat)])
    starts = np.cumsum(counts) - counts
    triples = [np.empty((0, 3), dtype=np.int64)]
    for i in range(1, int(counts.max(initial=0)) - 1):
        first = starts[counts > i + 1]
        triples.append(np.stack([flat[first], flat[first + i], flat[first + i + 1]], axis=1))
    return np.concatenate(triples)


_CORNERS: Mapping[str, Callable[[Array, Array | None], Array]] = {
    "triangles": lambda flat, _: flat[: len(flat) // 3 * 3].reshape(-1, 3),
    "polylist": _fan,
    "polygons": _fan,
    "trifans": _fan,
    "tristrips": lambda flat, _: np.stack([flat[:-2], flat[1:-1], flat[2:]], axis=1),
}


def _transform(node: Element) -> Array:
    """Return the transform (4, 4) from the frame of a node to its parent's frame."""
    pose = np.eye(4)
    for element in node.iterfind("{*}*"):
        tag = etree.QName(element).localname
        if tag not in ("matrix", "translate", "rotate", "scale"):
            continue
        values, step = _numbers(element, np.float64), np.eye(4)
        if tag == "matrix":
            step = values.reshape(4, 4)
        elif tag == "translate":
            step[:3, 3] = values
        elif tag == "scale":
            step[:3, :3] = np.diag(values)
        else:
            step[:3, :3] = _rotation(values[:3], radians(values[3]))
        pose = pose @ step
    return pose


def _rotation(axis: Array, angle: float) -> Array:
    size = length(axis)
    if size == 0.0:
        return np.eye(3)
    x, y, z = axis / size
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    sin, cos = elementary.sin_cos(angle)
    return np.asarray(np.eye(3) + sin * skew + product((1 - cos) * skew, skew))
