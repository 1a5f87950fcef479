"""A link of an SDF file: its collision shapes, friction and inertia."""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from lxml.etree import _Element as Element

from evoros.base.arrays import Array, principal_axes
from evoros.base.errors import InputError
from evoros.formats import strict_xml as xml
from evoros.formats.missing import MissingFileError
from evoros.formats.notes import Notes
from evoros.formats.sdf.frames import Frames, Path
from evoros.formats.sdf.geometry import read_geometry
from evoros.formats.sdf.reading import LOG, Reading
from evoros.geometry.footprint import bottom_height
from evoros.geometry.polyhedron import solid_centre, solid_volume, symmetric_tensor
from evoros.geometry.shapes import Pose, Shape, Vector

_MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
_ASSUMED = "the inertia of homogeneous shapes is assumed"


@dataclass(frozen=True, eq=False)
class Inertia:
    """The inertia of a link; ``pose`` is at the centre of mass, in the world frame."""

    mass: float  # [kg]
    pose: Pose
    moments: Array | None  # (3, 3) [kg m2] about the axes of ``pose``; None if not given


Weights = Iterable[tuple[Shape, Pose, float]]  # shapes, world poses and densities [kg/m3]


def read_inertia(
    link: Element, path: Path, frames: Frames, weights: Weights, notes: Notes
) -> Inertia:
    """Read the inertia of a link; replace impossible masses and moments, with a note."""
    inertial = xml.find_child(link, "inertial")
    if inertial is None:
        return Inertia(1.0, frames.world_pose(path), None)
    if is_auto(link):
        return _compute_inertia(frames.world_pose(path), weights)
    element = xml.find_child(inertial, "mass")
    mass = 1.0 if element is None else xml.read_numbers(element, 1)[0]
    pose = frames.resolve(inertial, path)
    if element is not None and mass <= 0:
        notes.add(element, f"must be greater than 0, not {mass:g}: 1 kg is assumed", "no mass")
        return Inertia(1.0, pose, None)
    moments = xml.find_child(inertial, "inertia")
    return Inertia(mass, pose, None if moments is None else _read_moments(moments, notes))


def is_auto(link: Element) -> bool:
    """Return True if the inertia of a link is computed from its collisions."""
    inertial = link.find("inertial")
    return inertial is not None and xml.is_set(inertial, "auto")


def _compute_inertia(pose: Pose, weights: Weights) -> Inertia:
    mass, moment = 0.0, np.zeros(3)
    for shape, place, density in weights:
        if shape.kind in ("plane", "heightfield"):
            continue
        share = density * solid_volume(shape)
        mass += share
        moment += share * np.array(place.transform(solid_centre(shape)))
    if mass <= 0:
        return Inertia(1.0, pose, None)
    x, y, z = (moment / mass).tolist()
    return Inertia(mass, Pose((x, y, z), pose.quaternion), None)


def _read_moments(inertia: Element, notes: Notes) -> Array | None:
    """Read the first moment of each name; None if no solid can have these moments."""
    values = {
        tag: xml.read_numbers(element, 1)[0]
        for tag in _MOMENTS
        if (element := inertia.find(tag)) is not None
    }
    lacking = [tag for tag in _MOMENTS[:3] if tag not in values]
    if lacking:
        notes.add(inertia, f"has no {', '.join(lacking)}: {_ASSUMED}", "moments lacking")
        return None
    tensor = symmetric_tensor(*(values.get(tag, 0.0) for tag in _MOMENTS))
    if principal_axes(tensor)[0][0] <= 0:
        problem = f"is not positive definite, which is impossible for a solid: {_ASSUMED}"
        notes.add(inertia, problem, "moments impossible")
        return None
    return tensor


@dataclass(frozen=True, eq=False)
class Solid:
    """A collision of a link: its world pose, and its shapes in the collision frame."""

    name: str
    pose: Pose
    shapes: tuple[Shape, ...]
    friction: float
    density: float  # [kg/m3]

    def place(self, shape: Shape) -> Pose:
        """Return the world pose of a shape."""
        return self.pose if shape.pose == Pose() else self.pose @ shape.pose

    @property
    def bottom(self) -> float:
        """The height [m] of the shapes' lowest point."""
        return min(bottom_height(shape, self.place(shape)) for shape in self.shapes)


@dataclass(frozen=True, eq=False)
class Link:
    """A link with its collisions and inertia."""

    path: Path
    element: Element
    solids: tuple[Solid, ...]
    inertia: Inertia | None  # None for a static link
    held: bool = False  # whether a link of a movable model is immobile


def read_link(element: Element, path: Path, frames: Frames, static: bool, reading: Reading) -> Link:
    """Read a link; ``static`` is whether its model is static."""
    names: set[str] = set()
    solids: list[Solid] = []
    for collision in element.findall("collision"):
        name = xml.read_name(collision)
        if name in names:
            raise xml.element_error(
                collision, "has a name that is already in use", "rename one of the two"
            )
        names.add(name)
        pose = frames.resolve(collision, path)
        shapes = _read_shapes(collision, element, pose, path, frames, reading)
        if shapes:
            friction, density = _read_friction(collision), _read_density(collision, element)
            solids.append(Solid(name, pose, shapes, friction, density))
    if not names and any(element.find(tag) is not None for tag in ("visual", "inertial")):
        problem = (
            "is left out: without a <collision>, nothing can touch or see the model; add a "
            "<collision>"
        )
        reading.notes.add(element, f"{problem}, such as the shape of the <visual>")
    if static:
        return Link(path, element, tuple(solids), None)
    held = bool(solids) and _is_held(element, solids, reading)
    if solids and not held and element.find("inertial/mass") is None and not is_auto(element):
        problem = "is not static and has no mass: SDF's default of 1 kg is assumed"
        reading.notes.add(element, problem)
    weights = (
        (shape, solid.place(shape), solid.density) for solid in solids for shape in solid.shapes
    )
    inertia = read_inertia(element, path, frames, weights, reading.notes)
    return Link(path, element, tuple(solids), inertia, held)


def _is_held(link: Element, solids: Sequence[Solid], reading: Reading) -> bool:
    for tag, moves in (("gravity", True), ("kinematic", False)):
        element = xml.find_child(link, tag)
        if element is not None and xml.read_flag(element) != moves:
            problem = f"is {str(not moves).lower()}, so the link is fixed in place"
            reading.notes.add(element, problem)
            return True
    kinds = {shape.kind for solid in solids for shape in solid.shapes}
    kind = next((kind for kind in ("plane", "heightfield") if kind in kinds), "")
    if kind:
        reading.notes.add(link, f"is fixed in place, because a link with a {kind} cannot move")
    return bool(kind)


def _read_shapes(
    collision: Element, link: Element, pose: Pose, path: Path, frames: Frames, reading: Reading
) -> tuple[Shape, ...]:
    """Return the shapes of a collision in its own frame; ``pose`` is its world pose."""
    if xml.touches_nothing(collision):
        problem = "is left out: <contact> or <max_contacts> lets everything pass through the shape"
        reading.notes.add(collision, problem, "passable")
        return ()
    try:
        return read_geometry(xml.require_child(collision, "geometry"), reading)
    except MissingFileError:
        if reading.options.missing == "error":
            raise
        box = None
        if reading.options.missing == "box":
            box = _substitute_box(link, path, frames, reading)
        if box is None:
            problem = "is left out: the file is missing or cannot be read"
            reading.notes.add(collision, problem, "missing shape")
            return ()
        shape, place, origin = box
        size = " x ".join(f"{edge:.3g}" for edge in shape.size)
        problem = (
            f"names a missing mesh, which is replaced with a {size} m box from the link's {origin}"
        )
        reading.notes.add(collision, problem, "box")
        return (replace(shape, pose=pose.inverse() @ place),)


def _read_friction(collision: Element) -> float:
    """Read the friction coefficient mu for ODE, else for Bullet, else return SDF's default of 1."""
    surface = xml.find_child(collision, "surface")
    friction = None if surface is None else xml.find_child(surface, "friction")
    if friction is None:
        return 1.0
    coefficients: list[float] = []
    for engine, tag in (("ode", "mu"), ("bullet", "friction")):
        element = xml.find_child(friction, engine)
        if element is not None:
            coefficients += _read_coefficient(xml.find_child(element, tag))
    _read_coefficient(friction.find("ode/mu2"))  # checked only: mu applies in all directions
    return coefficients[0] if coefficients else 1.0


def _read_coefficient(element: Element | None) -> list[float]:
    if element is None:
        return []
    return [min(xml.read_meaning(element, "friction/mu"), xml.MAX_NUMBER)]


def _read_density(collision: Element, link: Element) -> float:
    """Return the density [kg/m3] of a collision: its own, its link's, or water's."""
    for element in (collision.find("density"), link.find("inertial/density")):
        if element is not None:
            return xml.read_positive(element, 1)[0]
    return 1000.0


def _substitute_box(
    link: Element, path: Path, frames: Frames, reading: Reading
) -> tuple[Shape, Pose, str] | None:
    """Return a box that replaces the mesh of a link, its world pose, and the origin of its size."""
    silent = copy(reading)  # notes on visuals are irrelevant
    silent.notes = Notes(LOG)
    for visual in link.findall("visual"):
        geometry, box = visual.find("geometry"), None
        if geometry is not None:
            with suppress(InputError):
                box = _bounding_box(read_geometry(geometry, silent))
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
    if shape.kind == "convex":
        return shape.corners
    a, b, c = (edge / 2 for edge in shape.size) if shape.kind == "box" else (shape.size[0],) * 3
    if shape.kind == "cylinder":
        c = shape.size[1] / 2
    return tuple((i * a, j * b, k * c) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1))


def _equivalent_box(inertia: Inertia) -> Vector | None:
    """Return the edges [m] of a homogeneous box with these moments, or None if impossible."""
    if inertia.moments is None:
        return None
    moments = inertia.moments.diagonal()
    squares = 6 / inertia.mass * (moments.sum() - 2 * moments)
    if squares.min() <= 0:
        return None
    x, y, z = np.sqrt(squares).tolist()
    return (x, y, z)
