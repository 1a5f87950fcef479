"""The looks of a robot: what its links show, in their colours."""

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import chain, repeat
from pathlib import Path

import numpy as np
from lxml.etree import _Element as Element

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.formats.mesh_files import read_faces
from evoros.formats.urdf.parts import read_origin, read_shape, read_values
from evoros.formats.urdf.tree import Urdf
from evoros.geometry import triangles as geometry
from evoros.geometry.shapes import Vector
from evoros.terminal.log import LOGGER

from .surfaces import Colour, Surface

UNPAINTED = (0.6, 0.6, 0.6)  # colour of what has none
MOST_FACES = 24_000
"""Meshes of one robot have about this number of triangles together; finer ones are coarsened."""
_LEAST_FACES = 400  # of one mesh
_FINEST, _COARSER = 1 / 400, 1.25  # first cell over the extent of a mesh, and the steps from there


def make_surfaces(
    robot: Element, tree: Urdf, most_faces: int = MOST_FACES
) -> Iterator[tuple[str, Surface]]:
    """Yield each link with the surface that it shows.

    A mesh has its own colours, or the ``<material>`` of its link if it has none. If one of a link's
    visuals cannot be read, the link shows its collision shapes.
    """
    named = {
        material.get("name"): colour
        for material in robot.iter("material")
        if (colour := _read_colour(material)) is not None
    }
    count = len(robot.findall("link/visual/geometry/mesh"))
    most = max(_LEAST_FACES, most_faces // max(count, 1))
    for link in robot.findall("link"):
        name, visuals = str(link.get("name")), link.findall("visual")
        colours = [_choose_colour(visual, named) for visual in visuals]
        if link.find("visual/geometry/mesh") is None:
            yield name, _show_shapes(tree, name, colours)
            continue
        try:
            parts = [_show(*each, most) for each in zip(visuals, colours, strict=True)]
            yield name, _join(parts)
        except InputError as error:  # no robot is refused for its looks
            LOGGER.warning("%s; the collision shapes of %s are shown", error, name)
            yield name, _show_shapes(tree, name, colours)


def _show_shapes(tree: Urdf, link: str, colours: Sequence[Colour]) -> Surface:
    """Return the surface of the shapes of a link; there may be more of them than of colours."""
    shapes = tree.visuals[link]
    painted = chain(colours, repeat(colours[-1] if colours else UNPAINTED))
    shown = [colour for _, colour in zip(shapes, painted, strict=False)]
    return Surface.from_shapes(shapes, shown)


def _show(visual: Element, colour: Colour, most: int) -> Surface:
    mesh = visual.find("geometry/mesh")
    if mesh is None:
        return Surface.from_shapes([read_shape(visual)], [colour])
    name = str(mesh.get("filename"))
    path = Path(name.removeprefix("file://"))
    if not path.is_absolute() or not path.is_file():
        raise InputError(f"{name}: must be a file, but is missing; restore it")
    x, y, z = read_values(mesh, "scale", 3, "1 1 1")
    triangles, colours = _read_coarse(path, (x, y, z), most, path.stat().st_mtime_ns)
    painted = np.where(np.isnan(colours), colour, colours)
    pose = read_origin(visual)
    return Surface.from_triangles(triangles @ pose.rotation.T + pose.position, painted, True)


@lru_cache(maxsize=64)  # wheels share a file, and missions a robot
def _read_coarse(path: Path, scale: Vector, most: int, changed_ns: int) -> tuple[Array, Array]:
    """Read a mesh as at most ``most`` triangles, with colours; ``changed_ns`` tells its version."""
    faces = read_faces(path, scale, painted=True)
    return _coarsen(faces.triangles, faces.colours, most)


def _coarsen(triangles: Array, colours: Array, most: int) -> tuple[Array, Array]:
    """Return at most ``most`` triangles nearly as given ones, and their colours."""
    whole = geometry.Surface(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
    cell = _FINEST * float(np.ptp(whole.points, axis=0).max())
    joined, kept = whole, whole.faces[:, 0] // 3
    while len(kept) > most and cell > 0.0:
        joined, kept, _ = geometry.join_near(whole, cell)
        cell *= _COARSER
    return joined.triangles, colours[kept]


def _join(parts: Sequence[Surface]) -> Surface:
    """Join the surfaces of a link; all are seen from both sides, as one of them is."""
    triangles, colours = ([getattr(p, name) for p in parts] for name in ("triangles", "colours"))
    return Surface.from_triangles(np.concatenate(triangles), np.concatenate(colours), True)


def _choose_colour(visual: Element, named: Mapping[str | None, Colour]) -> Colour:
    material = visual.find("material")
    if material is None:
        return UNPAINTED
    return _read_colour(material) or named.get(material.get("name"), UNPAINTED)


def _read_colour(material: Element) -> Colour | None:
    """Read the colour of a material; None: it has none, or one that cannot be read."""
    color = material.find("color")
    try:
        red, green, blue, _ = map(float, "" if color is None else str(color.get("rgba")).split())
    except ValueError:  # no robot is refused for its looks
        return None
    return red, green, blue
