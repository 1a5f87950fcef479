"""A link of an SDF file: its collision shapes, friction and inertia."""

from dataclasses import dataclass

import numpy as np
from lxml.etree import _Element as Element

from evoros.base.arrays import Array
from evoros.formats.sdf.elements import LOG, check_children
from evoros.formats.sdf.frames import Frames, Path
from evoros.formats.strict_xml import (
    element_error,
    find_child,
    read_flag,
    read_name,
    read_number,
    read_numbers,
    read_positive,
    require_child,
    warn,
)
from evoros.geometry.inertia import symmetric_tensor
from evoros.geometry.shapes import Pose, Shape


@dataclass(frozen=True, eq=False)
class Inertia:
    """The inertia of a link; ``pose`` is at its centre of mass, in the world."""

    mass: float  # [kg]
    pose: Pose
    moments: Array | None  # (3, 3) [kg m2] about the axes of ``pose``; None: not given


@dataclass(frozen=True, eq=False)
class Solid:
    """A collision shape of a link; the pose of the shape is in the world."""

    name: str
    shape: Shape
    friction: float


@dataclass(frozen=True, eq=False)
class Link:
    """A link with its collision shapes and inertia."""

    path: Path
    element: Element
    solids: tuple[Solid, ...]
    inertia: Inertia | None  # None: static


def read_link(element: Element, path: Path, frames: Frames, static: bool) -> Link:
    """Read a link; ``static`` if it belongs to a static model."""
    check_children(element)
    names: set[str] = set()
    solids: list[Solid] = []
    for collision in element.findall("collision"):
        name = read_name(collision)
        if name in names:
            raise element_error(collision, "has a name that is taken", "rename one of the two")
        names.add(name)
        shape = _read_shape(collision, frames.resolve(collision, path))
        if shape is not None:
            solids.append(Solid(name, shape, _read_friction(collision)))
    inertia = _read_inertia(element, path, frames)
    if not static:
        _check_movable(element)
        if element.find("inertial/mass") is None:
            warn(LOG, element, "is not static and has no mass: it gets 1 kg, the default of SDF")
    return Link(path, element, tuple(solids), None if static else inertia)


def _check_movable(link: Element) -> None:
    for tag, required in (("gravity", True), ("kinematic", False)):
        element = find_child(link, tag)
        if element is not None and read_flag(element) != required:
            problem = f"must be {str(required).lower()} in a model that is not static"
            raise element_error(element, problem, "make the model static")


def _read_shape(collision: Element, pose: Pose) -> Shape | None:
    check_children(collision)
    geometry = require_child(collision, "geometry")
    check_children(geometry)
    if len(geometry) != 1:
        element = geometry[1] if len(geometry) else geometry
        problem = f"makes {len(geometry)} shapes in one <geometry>, not one"
        raise element_error(element, problem, "write one <collision> for each shape")
    solid = geometry[0]
    kind = str(solid.tag)
    check_children(solid)
    if kind == "box":
        return Shape(kind, read_positive(require_child(solid, "size"), 3), pose)
    if kind == "sphere":
        return Shape(kind, read_positive(require_child(solid, "radius"), 1), pose)
    if kind == "cylinder":
        lengths = (read_positive(require_child(solid, tag), 1) for tag in ("radius", "length"))
        (radius,), (length,) = lengths
        return Shape(kind, (radius, length), pose)
    if kind == "plane":
        return Shape(kind, _read_normal(solid), pose)
    return None  # <empty>


def _read_normal(plane: Element) -> tuple[float, ...]:
    size, normal = find_child(plane, "size"), find_child(plane, "normal")
    if size is not None:  # only for its picture: a plane has no end
        read_positive(size, 2)
    if normal is None:
        return (0.0, 0.0, 1.0)
    values = read_numbers(normal, 3)
    if sum(n * n for n in values) < 1e-12:
        raise element_error(normal, "must not be 0 0 0", "write 0 0 1 for level ground")
    return values


def _read_friction(collision: Element) -> float:
    """Read the coefficient mu: that for ODE, else that for Bullet, else SDF's default 1."""
    surface = find_child(collision, "surface")
    if surface is None:
        return 1.0
    check_children(surface)
    friction = find_child(surface, "friction")
    if friction is None:
        return 1.0
    check_children(friction)
    coefficients: list[float] = []
    for engine, tag in (("ode", "mu"), ("bullet", "friction")):
        element = find_child(friction, engine)
        if element is not None:
            check_children(element)
            coefficients += _read_coefficient(find_child(element, tag))
    _read_coefficient(friction.find("ode/mu2"))  # unused: friction has no direction here
    return coefficients[0] if coefficients else 1.0


def _read_coefficient(element: Element | None) -> list[float]:
    if element is None:
        return []
    return [read_number(element, "a number of at least 0", lambda v: v >= 0)]


def _read_inertia(link: Element, path: Path, frames: Frames) -> Inertia:
    inertial = find_child(link, "inertial")
    if inertial is None:
        return Inertia(1.0, frames.world_pose(path), None)
    check_children(inertial)
    if inertial.get("auto", "false") not in ("false", "0"):
        raise element_error(inertial, "must not be auto", "delete auto and write its <mass>")
    element = find_child(inertial, "mass")
    mass = 1.0 if element is None else read_positive(element, 1)[0]
    pose = frames.resolve(inertial, path)
    moments = find_child(inertial, "inertia")
    return Inertia(mass, pose, None if moments is None else _read_moments(moments))


def _read_moments(inertia: Element) -> Array:
    check_children(inertia)
    xx, yy, zz = (read_positive(require_child(inertia, t), 1)[0] for t in ("ixx", "iyy", "izz"))
    products = (find_child(inertia, tag) for tag in ("ixy", "ixz", "iyz"))
    xy, xz, yz = (0.0 if element is None else read_numbers(element, 1)[0] for element in products)
    tensor = symmetric_tensor(xx, yy, zz, xy, xz, yz)
    if np.linalg.eigvalsh(tensor)[0] <= 0:
        raise element_error(inertia, "must be positive definite", "correct or delete its moments")
    return tensor
