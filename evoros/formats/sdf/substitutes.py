"""A box that stands for a mesh that cannot be read."""

from copy import copy
from dataclasses import replace

import numpy as np
from lxml.etree import _Element as Element

from evoros.base.errors import InputError
from evoros.formats.notes import Notes
from evoros.formats.sdf.frames import Frames, Path
from evoros.formats.sdf.geometry import read_geometry
from evoros.formats.sdf.inertial import Inertia, read_inertia
from evoros.formats.sdf.reading import LOG, Reading
from evoros.geometry.shapes import Pose, Shape, Vector


def substitute_box(
    link: Element, path: Path, frames: Frames, reading: Reading
) -> tuple[Shape, Pose, str] | None:
    """Return a box for a link, its pose in the world, and where it comes from.

    It is the box around the link's first visual that can be read, else the homogeneous box with
    the link's inertia; None if there is neither.
    """
    silent = copy(reading)  # how a visual is read does not matter: only its box is used
    silent.notes = Notes(LOG)
    for visual in link.findall("visual"):
        geometry = visual.find("geometry")
        if geometry is None:
            continue
        try:
            shapes = read_geometry(geometry, silent)
        except InputError:
            continue
        box = _bounding_box(shapes)
        if box is not None:
            return replace(box, pose=Pose()), frames.resolve(visual, path) @ box.pose, "visual"
    if link.find("inertial/inertia") is None:
        return None
    inertia = read_inertia(link, path, frames, (), Notes(LOG))
    edges = _equivalent_box(inertia)
    return None if edges is None else (Shape("box", edges), inertia.pose, "inertia")


def _bounding_box(shapes: tuple[Shape, ...]) -> Shape | None:
    points: list[Vector] = []
    for shape in shapes:
        if shape.kind in ("plane", "heightfield"):
            return None
        points += (shape.pose.transform(corner) for corner in _corners(shape))
    if not points:
        return None
    low, high = np.min(points, axis=0), np.max(points, axis=0)
    x, y, z = ((low + high) / 2).tolist()
    return Shape("box", tuple(np.maximum(high - low, 1e-3).tolist()), Pose((x, y, z)))


def _corners(shape: Shape) -> tuple[Vector, ...]:
    """Return the corners of a shape, or of the box around it."""
    if shape.kind == "convex":
        return shape.corners
    if shape.kind == "box":
        a, b, c = (edge / 2 for edge in shape.size)
    else:
        a = b = shape.size[0]
        c = shape.size[1] / 2 if shape.kind == "cylinder" else a
    return tuple((i * a, j * b, k * c) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1))


def _equivalent_box(inertia: Inertia) -> Vector | None:
    """Return the edges [m] of the homogeneous box along the axes that has these moments."""
    if inertia.moments is None:
        return None
    moments = inertia.moments.diagonal()
    squares = 6 / inertia.mass * (moments.sum() - 2 * moments)
    if squares.min() <= 0:
        return None
    x, y, z = np.sqrt(squares).tolist()
    return (x, y, z)
