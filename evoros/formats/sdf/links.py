"""A link of an SDF file: its shapes, surface and inertia, and the body that links make."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from lxml.etree import _Element as Element

from evoros.base.arrays import Array
from evoros.formats.sdf.elements import LOG, check_children
from evoros.formats.sdf.frames import Frames, Path
from evoros.formats.strict_xml import (
    child,
    fault,
    flag,
    name_of,
    needed,
    number,
    numbers,
    positive,
    warn,
)
from evoros.geometry.shapes import Body, Pose, Shape, Vector


@dataclass(frozen=True, eq=False)
class Inertia:
    """Of a link: ``pose`` is at its centre of mass, in the world."""

    mass: float  # [kg]
    pose: Pose
    moments: Array | None  # (3, 3) about the axes of `pose` [kg m2]; None: not given


@dataclass(frozen=True, eq=False)
class Link:
    """What a link brings to its body. The poses of the shapes are in the world."""

    path: Path
    element: Element
    shapes: tuple[tuple[str, Shape, float], ...]  # name, shape, friction
    inertia: Inertia | None  # None: static


def read_link(element: Element, path: Path, frames: Frames, fixed: bool) -> Link:
    """Read a link; ``fixed`` if it belongs to a static model."""
    check_children(element)
    names: set[str] = set()
    shapes: list[tuple[str, Shape, float]] = []
    for collision in element.findall("collision"):
        name = name_of(collision)
        if name in names:
            raise fault(collision, "has a name that is taken", "rename one of the two")
        names.add(name)
        shape = _shape(collision, frames.pose_of(collision, path))
        if shape is not None:
            shapes.append((name, shape, _friction(collision)))
    inertia = _inertia(element, path, frames)
    if not fixed:
        _check_free(element)
        if element.find("inertial/mass") is None:
            warn(LOG, element, "is not static and has no mass: 1 kg is taken, as SDF says")
    return Link(path, element, tuple(shapes), None if fixed else inertia)


def _check_free(link: Element) -> None:
    gravity, kinematic = child(link, "gravity"), child(link, "kinematic")
    if gravity is not None and not flag(gravity):
        raise fault(gravity, "must be true for what is not static", "make the model static")
    if kinematic is not None and flag(kinematic):
        raise fault(kinematic, "must be false for what is not static", "make the model static")


def _shape(collision: Element, pose: Pose) -> Shape | None:
    check_children(collision)
    geometry = needed(collision, "geometry")
    check_children(geometry)
    if len(geometry) != 1:
        where = geometry[1] if len(geometry) else geometry
        problem = f"makes {len(geometry)} shapes in one <geometry>, not one"
        raise fault(where, problem, "use one <collision> for each")
    solid = geometry[0]
    kind = str(solid.tag)
    check_children(solid)
    if kind == "box":
        return Shape(kind, positive(needed(solid, "size"), 3), pose)
    if kind == "sphere":
        return Shape(kind, positive(needed(solid, "radius"), 1), pose)
    if kind == "cylinder":
        (radius,), (length,) = (positive(needed(solid, tag), 1) for tag in ("radius", "length"))
        return Shape(kind, (radius, length), pose)
    if kind == "plane":
        return Shape(kind, _normal(solid), pose)
    return None  # <empty>


def _normal(plane: Element) -> tuple[float, ...]:
    size, normal = child(plane, "size"), child(plane, "normal")
    if size is not None:  # what is drawn: a plane has no end
        positive(size, 2)
    if normal is None:
        return (0.0, 0.0, 1.0)
    values = numbers(normal, 3)
    if sum(n * n for n in values) < 1e-12:
        raise fault(normal, "must not be 0 0 0", "write 0 0 1 for level ground")
    return values


def _friction(collision: Element) -> float:
    """The coefficient mu: that for ODE, else that for Bullet, else SDF's default 1."""
    surface = child(collision, "surface")
    friction = None if surface is None else child(surface, "friction")
    if surface is not None:
        check_children(surface)
    if friction is None:
        return 1.0
    check_children(friction)
    found: list[float] = []
    for engine, tag in (("ode", "mu"), ("bullet", "friction")):
        part = child(friction, engine)
        if part is None:
            continue
        check_children(part)
        value = child(part, tag)
        if value is not None:
            found.append(number(value, "a number of at least 0", lambda v: v >= 0))
    second = friction.find("ode/mu2")
    if second is not None:  # friction is the same in all directions here
        number(second, "a number of at least 0", lambda v: v >= 0)
    return found[0] if found else 1.0


def _inertia(link: Element, path: Path, frames: Frames) -> Inertia:
    inertial = child(link, "inertial")
    if inertial is None:
        return Inertia(1.0, frames.world_pose(path), None)
    check_children(inertial)
    if inertial.get("auto", "false") not in ("false", "0"):
        raise fault(inertial, "must not be auto", "write its <mass>")
    mass = child(inertial, "mass")
    kilograms = 1.0 if mass is None else positive(mass, 1)[0]
    pose = frames.pose_of(inertial, path)
    moments = child(inertial, "inertia")
    return Inertia(kilograms, pose, None if moments is None else _moments(moments))


def _moments(inertia: Element) -> Array:
    check_children(inertia)
    xx, yy, zz = (positive(needed(inertia, tag), 1)[0] for tag in ("ixx", "iyy", "izz"))
    found = (child(inertia, tag) for tag in ("ixy", "ixz", "iyz"))
    xy, xz, yz = (0.0 if element is None else numbers(element, 1)[0] for element in found)
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if np.linalg.eigvalsh(tensor)[0] <= 0:
        raise fault(inertia, "must be positive definite", "correct its moments, or delete it")
    return tensor


def fixed_bodies(links: Sequence[Link]) -> list[Body]:
    """One body for each shape of static links: each keeps its own friction."""
    solids = [(link, *solid) for link in links for solid in link.shapes]
    alone = len(solids) == 1
    return [
        Body(
            link.path[0] if alone else "::".join((*link.path, name)),
            shape.pose,
            (Shape(shape.kind, shape.size),),
            friction=friction,
        )
        for link, name, shape, friction in solids
    ]


def movable_body(links: Sequence[Link], alone: bool) -> list[Body]:
    """The body of links that move as one; none if nothing can touch it.

    ``alone`` if its model has no other body, so that it may have the model's name.
    """
    first = links[0]
    solids = [(link, *solid) for link in links for solid in link.shapes]
    if not solids:
        warn(LOG, first.element, "is left out: it has no collision, so nothing can touch it")
        return []
    _, _, _, friction = solids[0]
    for link, name, shape, other in solids:
        if shape.kind == "plane":
            raise fault(link.element, f"has a plane ({name}), but can move", "make it static")
        if other != friction:
            problem = f"has friction {friction:g} and {other:g} in one movable body"
            raise fault(link.element, problem, "give all its collisions the same")
    inertias = [link.inertia for link in links if link.inertia is not None]
    mass, pose, moments = _combined(inertias)
    back = pose.inverse()
    shapes = tuple(Shape(shape.kind, shape.size, back @ shape.pose) for _, _, shape, _ in solids)
    name = first.path[0] if alone else "::".join(first.path)
    return [Body(name, pose, shapes, mass, friction, moments)]


def _combined(parts: Sequence[Inertia]) -> tuple[float, Pose, Vector | None]:
    """Mass, principal frame in the world and principal moments of parts joined rigidly."""
    if len(parts) == 1 and (parts[0].moments is None or _is_diagonal(parts[0].moments)):
        moments = parts[0].moments
        return parts[0].mass, parts[0].pose, None if moments is None else _vector(np.diag(moments))
    masses = np.array([part.mass for part in parts])
    mass = float(masses.sum())
    center = masses @ np.array([part.pose.position for part in parts]) / mass
    total = np.zeros((3, 3))
    for part in parts:
        if part.moments is None:
            return mass, Pose(_vector(center), parts[0].pose.quaternion), None
        turn, arm = part.pose.rotation, np.array(part.pose.position) - center
        # Steiner: the moments of a part about the common centre of mass.
        total += turn @ part.moments @ turn.T
        total += part.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    principal, axes = np.linalg.eigh(total)
    axes[:, 0] *= np.sign(np.linalg.det(axes))  # right-handed
    return mass, Pose.from_matrix(_vector(center), axes), _vector(principal)


def _is_diagonal(matrix: Array) -> bool:
    return bool(np.count_nonzero(matrix - np.diag(np.diag(matrix))) == 0)


def _vector(values: Array) -> Vector:
    x, y, z = (float(value) for value in values)
    return (x, y, z)
