"""A link of an SDF file: its collision shapes, friction and inertia.

A box may stand for a mesh that cannot be read.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from lxml.etree import _Element as Element

from evoros.base.errors import InputError
from evoros.formats.missing import MissingFileError
from evoros.formats.notes import Notes
from evoros.formats.sdf.frames import Frames, Path
from evoros.formats.sdf.geometry import read_geometry
from evoros.formats.sdf.inertial import Inertia, is_auto, read_inertia
from evoros.formats.sdf.reading import LOG, Reading
from evoros.formats.strict_xml import (
    element_error,
    find_child,
    read_flag,
    read_name,
    read_number,
    read_positive,
    require_child,
)
from evoros.geometry.shapes import Pose, Shape, Vector


@dataclass(frozen=True, eq=False)
class Solid:
    """A collision of a link: its pose in the world, and shapes in its frame."""

    name: str
    pose: Pose
    shapes: tuple[Shape, ...]
    friction: float
    density: float  # [kg/m3]

    def place(self, shape: Shape) -> Pose:
        """Return the pose of a shape in the world."""
        return self.pose if shape.pose == Pose() else self.pose @ shape.pose


@dataclass(frozen=True, eq=False)
class Link:
    """A link with its collisions and inertia."""

    path: Path
    element: Element
    solids: tuple[Solid, ...]
    inertia: Inertia | None  # None: static
    held: bool = False  # it does not move, although its model is not static


def read_link(element: Element, path: Path, frames: Frames, static: bool, reading: Reading) -> Link:
    """Read a link; ``static`` if it belongs to a static model."""
    names: set[str] = set()
    solids: list[Solid] = []
    for collision in element.findall("collision"):
        name = read_name(collision)
        if name in names:
            raise element_error(collision, "has a name that is taken", "rename one of the two")
        names.add(name)
        pose = frames.resolve(collision, path)
        shapes = _read_shapes(collision, element, pose, path, frames, reading)
        if shapes:
            friction, density = _read_friction(collision), _read_density(collision, element)
            solids.append(Solid(name, pose, shapes, friction, density))
    if static:
        return Link(path, element, tuple(solids), None)
    held = bool(solids) and _is_held(element, solids, reading)
    if solids and not held and element.find("inertial/mass") is None and not is_auto(element):
        problem = "is not static and has no mass: it gets 1 kg, the default of SDF"
        reading.notes.add(element, problem)
    weights = (
        (shape, solid.place(shape), solid.density) for solid in solids for shape in solid.shapes
    )
    inertia = read_inertia(element, path, frames, weights, reading.notes)
    return Link(path, element, tuple(solids), inertia, held)


def _is_held(link: Element, solids: Sequence[Solid], reading: Reading) -> bool:
    """Whether a link that is not static stays where it is."""
    for tag, moves in (("gravity", True), ("kinematic", False)):
        element = find_child(link, tag)
        if element is not None and read_flag(element) != moves:
            problem = f"is {str(not moves).lower()}: its link is fixed where it is"
            reading.notes.add(element, problem)
            return True
    kinds = {shape.kind for solid in solids for shape in solid.shapes}
    kind = next((kind for kind in ("plane", "heightfield") if kind in kinds), "")
    if kind:
        reading.notes.add(link, f"has a {kind} and is fixed where it is, as it cannot move")
    return bool(kind)


def _read_shapes(
    collision: Element, link: Element, pose: Pose, path: Path, frames: Frames, reading: Reading
) -> tuple[Shape, ...]:
    """Return the shapes of a collision in its frame, whose pose in the world is ``pose``."""
    try:
        return read_geometry(require_child(collision, "geometry"), reading)
    except MissingFileError:
        if reading.options.missing == "error":
            raise
        box = None
        if reading.options.missing == "box":
            box = _substitute_box(link, path, frames, reading)
        if box is None:
            problem = "is left out: its file is absent or cannot be read"
            reading.notes.add(collision, problem, "missing shape")
            return ()
        shape, place, origin = box
        size = " x ".join(f"{edge:.3g}" for edge in shape.size)
        problem = f"names a mesh that is absent; a box of its {origin}, {size} m, stands for it"
        reading.notes.add(collision, problem, "box")
        return (replace(shape, pose=pose.inverse() @ place),)


def _read_friction(collision: Element) -> float:
    """Read the coefficient mu for ODE, else for Bullet, else take SDF's default 1."""
    surface = find_child(collision, "surface")
    if surface is None:
        return 1.0
    friction = find_child(surface, "friction")
    if friction is None:
        return 1.0
    coefficients: list[float] = []
    for engine, tag in (("ode", "mu"), ("bullet", "friction")):
        element = find_child(friction, engine)
        if element is not None:
            coefficients += _read_coefficient(find_child(element, tag))
    _read_coefficient(friction.find("ode/mu2"))  # unused: friction has no direction here
    return coefficients[0] if coefficients else 1.0


def _read_coefficient(element: Element | None) -> list[float]:
    if element is None:
        return []
    return [read_number(element, "a number of at least 0", lambda v: v >= 0)]


def _read_density(collision: Element, link: Element) -> float:
    """Return the density [kg/m3] of a collision, else of its link, else of water."""
    for element in (collision.find("density"), link.find("inertial/density")):
        if element is not None:
            return read_positive(element, 1)[0]
    return 1000.0


def _substitute_box(
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
