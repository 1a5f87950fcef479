"""Reads and checks elements of a URDF: joints, inertias and shapes."""

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from lxml.etree import _Element as Element

from evoros.base.arrays import Array, length
from evoros.base.errors import InputError, single_line
from evoros.formats import strict_xml as xml
from evoros.geometry.polyhedron import symmetric_tensor
from evoros.geometry.shapes import Pose, Shape

JOINT_TYPES = ("fixed", "continuous", "revolute", "prismatic", "planar", "floating")
LIMITED_TYPES = ("revolute", "prismatic")


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint in its zero position."""

    name: str
    type: str  # one of JOINT_TYPES
    parent: str
    child: str
    origin: Pose  # parent link frame
    axis: Array  # (3,) unit vector in the child link's frame
    lower: float  # [rad or m]; -inf: no limit
    upper: float  # [rad or m]; inf: no limit
    effort: float  # maximum torque or force [Nm or N]; inf: no limit
    velocity: float = math.inf  # maximum rate [rad/s or m/s]; inf: no limit


def read_values(
    element: Element, attribute: str, count: int, default: str | None = None
) -> list[float]:
    """Return the finite numbers in an attribute, ``count`` in all."""
    text = element.get(attribute, default)
    if text is None:
        raise xml.element_error(element, f"must have the attribute {attribute}", "add it")
    return parse_numbers(element, text, count, f" in {attribute}")


def parse_numbers(element: Element, text: str, count: int, place: str = "") -> list[float]:
    """Return the finite numbers in an element's string; ``place`` says where, for errors."""
    numbers = [xml.parse_number(word) for word in text.split()]
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        expected = f"{count} finite number{'s' * (count > 1)}"
        problem = f"must have {expected}{place}, not {xml.quote(text)}"
        braces = f" or, for a xacro property, ${{{text}}}" if "_" in text.strip("_") else ""
        raise xml.element_error(element, problem, f"write {expected}{braces}")
    return numbers


def read_value(element: Element, attribute: str, default: str | None = None) -> float:
    """Return the finite number in an attribute."""
    return read_values(element, attribute, 1, default)[0]


def read_lengths(solid: Element, attribute: str, count: int = 1) -> list[float]:
    """Return the lengths [m] of a solid, limited so that products cannot overflow."""
    lengths = read_values(solid, attribute, count)
    if max(lengths) > xml.MAX_NUMBER:
        problem = f"must have lengths of at most {xml.MAX_NUMBER:g} m in {attribute}, not {lengths}"
        raise xml.element_error(solid, problem, "write smaller lengths")
    return lengths


def read_origin(element: Element) -> Pose:
    """Read the ``<origin>`` of an element: xyz [m], and rpy [rad] about fixed axes."""
    origin = element.find("origin")
    if origin is None:
        return Pose()
    x, y, z = read_values(origin, "xyz", 3, "0 0 0")
    roll, pitch, yaw = read_values(origin, "rpy", 3, "0 0 0")
    try:
        return Pose.from_rpy((x, y, z), roll, pitch, yaw)
    except InputError as error:
        problem = f"must be a pose ({single_line(error)})"
        raise xml.element_error(
            origin, problem, "write xyz in metres and rpy in radians"
        ) from error


def read_tensor(inertia: Element) -> Array:
    """Read the inertia tensor (3, 3) [kg m2] of an ``<inertia>``."""
    xx, yy, zz = (read_value(inertia, name) for name in ("ixx", "iyy", "izz"))
    xy, xz, yz = (read_value(inertia, name, "0") for name in ("ixy", "ixz", "iyz"))
    return symmetric_tensor(xx, yy, zz, xy, xz, yz)


def read_joint(element: Element, links: Collection[str]) -> Joint:
    """Read a ``<joint>``; both of its links must be in ``links``."""
    kind = element.get("type", "")
    if kind not in JOINT_TYPES:
        problem = f"must be of type {', '.join(JOINT_TYPES)}, not {xml.quote(kind)}"
        raise xml.element_error(element, problem, "change its type")
    lower, upper, effort, velocity = _read_limit(element, kind)
    return Joint(
        name=xml.read_name(element),
        type=kind,
        parent=_read_end(element, "parent", links),
        child=_read_end(element, "child", links),
        origin=read_origin(element),
        axis=_read_axis(element) if kind != "fixed" else np.array([1.0, 0.0, 0.0]),
        lower=lower,
        upper=upper,
        effort=effort,
        velocity=velocity,
    )


def _read_end(joint: Element, tag: str, links: Collection[str]) -> str:
    end = xml.require_child(joint, tag)
    link = end.get("link", "")
    if link not in links:
        problem = f"must name an existing link, not {xml.quote(link)}"
        raise xml.element_error(end, problem, "add or rename the link")
    return link


def _read_axis(joint: Element) -> Array:
    element = joint.find("axis")
    axis = np.array([1.0, 0.0, 0.0] if element is None else read_values(element, "xyz", 3))
    size = length(axis)
    if element is not None and size < 1e-9:
        fix = "write the direction of the axis"
        raise xml.element_error(element, "must not have length 0", fix)
    return np.asarray(axis / size)


def _read_limit(joint: Element, kind: str) -> tuple[float, float, float, float]:
    """Return the lower and upper bounds, effort and velocity; infinite without ``<limit>``."""
    limit = joint.find("limit")
    if limit is None:
        return -math.inf, math.inf, math.inf, math.inf
    lower, upper, effort, velocity = (
        xml.read_meaning(limit, f"limit/{name}", limit.get(name, "0"))
        for name in ("lower", "upper", "effort", "velocity")
    )
    if kind not in LIMITED_TYPES:
        return -math.inf, math.inf, effort, velocity
    if kind == "revolute" and lower > upper:  # swap, as sdformat does
        lower, upper = upper, lower
    return lower, upper, effort, velocity


def read_shapes(link: Element) -> tuple[Shape, ...]:
    """Read the collision shapes of a link, in the link's frame."""
    return tuple(read_shape(collision) for collision in link.findall("collision"))


def read_visuals(link: Element) -> tuple[Shape, ...]:
    """Read a link's visual shapes, or the collision shapes if visuals are missing or meshes."""
    try:
        return tuple(map(read_shape, link.findall("visual"))) or read_shapes(link)
    except InputError:  # an unusable visual is no reason to reject a robot
        return read_shapes(link)


def read_shape(element: Element) -> Shape:
    """Read the shape of a ``<collision>`` or a ``<visual>``."""
    geometry = xml.require_child(element, "geometry")
    if len(geometry) != 1 or geometry[0].tag not in ("box", "cylinder", "sphere", "convex"):
        content = " and ".join(f"<{child.tag!s}>" for child in geometry) or "nothing"
        problem = f"must contain one box, cylinder or sphere, not {content}"
        raise xml.element_error(geometry, problem, "build the part from such collision shapes")
    solid = geometry[0]
    if solid.tag == "convex":  # written by this package in place of a mesh
        numbers = iter([float(word) for word in solid.get("corners", "").split()])
        corners = tuple(zip(numbers, numbers, numbers, strict=True))
        return Shape("convex", (), read_origin(element), corners=corners)
    if solid.tag == "box":
        size = read_lengths(solid, "size", 3)
    else:
        names = ("radius", "length") if solid.tag == "cylinder" else ("radius",)
        size = [length for name in names for length in read_lengths(solid, name)]
    if min(size) <= 0:
        problem = f"must have lengths above 0 m, not {size}"
        raise xml.element_error(solid, problem, "write positive lengths only")
    return Shape(str(solid.tag), tuple(size), read_origin(element))
