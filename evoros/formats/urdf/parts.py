"""Reads the elements of a URDF: joints, inertias, shapes, each checked as it is read."""

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from lxml.etree import _Element as Element

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.formats.strict_xml import fault, name_of, needed, shown
from evoros.geometry.shapes import Pose, Shape

JOINT_TYPES = ("fixed", "continuous", "revolute", "prismatic")
LIMITED = ("revolute", "prismatic")


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint at its zero position."""

    name: str
    type: str  # one of JOINT_TYPES
    parent: str
    child: str
    origin: Pose  # in the frame of the parent link
    axis: Array  # (3,) unit vector in the frame of the child link
    lower: float  # [rad or m], -inf where there is no limit
    upper: float
    effort: float  # greatest torque or force [Nm or N]; 0: it cannot be driven


def values(element: Element, attribute: str, count: int, default: str | None = None) -> list[float]:
    """The finite numbers in an attribute.

    Raises:
        InputError: there are not ``count`` of them, or there is no attribute and no default.
    """
    text = element.get(attribute, default)
    if text is None:
        raise fault(element, f"must have the attribute {attribute}", "add it")
    try:
        found = [float(word) for word in text.split()]
    except ValueError:
        found = []
    if len(found) != count or not all(map(math.isfinite, found)):
        rule = f"must have {count} finite number{'s' * (count > 1)} in {attribute}"
        raise fault(element, f"{rule}, not {shown(text)}", "correct it")
    return found


def value(element: Element, attribute: str, default: str | None = None) -> float:
    """The one finite number in an attribute."""
    return values(element, attribute, 1, default)[0]


def read_origin(element: Element) -> Pose:
    """The ``<origin>`` of an element: roll, pitch, yaw about fixed axes."""
    origin = element.find("origin")
    if origin is None:
        return Pose()
    x, y, z = values(origin, "xyz", 3, "0 0 0")
    roll, pitch, yaw = values(origin, "rpy", 3, "0 0 0")
    return Pose.from_rpy((x, y, z), roll, pitch, yaw)


def check_inertia(link: Element) -> None:
    """A link must have a mass, and a tensor that a body of positive density can have.

    Its principal moments are positive, and none is greater than the sum of the other two.
    """
    inertial = needed(link, "inertial")
    read_origin(inertial)
    mass = needed(inertial, "mass")
    if value(mass, "value") <= 0:
        raise fault(mass, f"must be greater than 0 kg, not {mass.get('value')}", "set it")
    tensor = needed(inertial, "inertia")
    xx, yy, zz = (value(tensor, name) for name in ("ixx", "iyy", "izz"))
    xy, xz, yz = (value(tensor, name, "0") for name in ("ixy", "ixz", "iyz"))
    least, middle, most = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if least <= 0 or least + middle < most * (1.0 - 1e-9):
        rule = "must have principal moments above 0, none above the sum of the others"
        found = f"not {least:g}, {middle:g} and {most:g} kg m2"
        raise fault(tensor, f"{rule}, {found}", "compute them from the shape of the part")


def read_joint(element: Element, links: Collection[str]) -> Joint:
    """A ``<joint>``; both its links must be among ``links``."""
    kind = element.get("type", "")
    if kind not in JOINT_TYPES:
        rule = f"must be of type {', '.join(JOINT_TYPES)}"
        raise fault(element, f"{rule}, not {shown(kind)}", "change its type")
    lower, upper, effort = _read_limit(element, kind)
    return Joint(
        name=name_of(element),
        type=kind,
        parent=_read_end(element, "parent", links),
        child=_read_end(element, "child", links),
        origin=read_origin(element),
        axis=_read_axis(element),
        lower=lower,
        upper=upper,
        effort=effort,
    )


def _read_end(joint: Element, tag: str, links: Collection[str]) -> str:
    end = needed(joint, tag)
    link = end.get("link", "")
    if link not in links:
        raise fault(end, f"must name an existing link, not {shown(link)}", "add or rename the link")
    return link


def _read_axis(joint: Element) -> Array:
    element = joint.find("axis")
    axis = np.array([1.0, 0.0, 0.0] if element is None else values(element, "xyz", 3))
    length = float(np.linalg.norm(axis))
    if element is not None and length < 1e-9:
        raise fault(element, "must not be of length 0", "write the direction")
    unit: Array = axis / length
    return unit


def _read_limit(joint: Element, kind: str) -> tuple[float, float, float]:
    limit = needed(joint, "limit") if kind in LIMITED else joint.find("limit")
    if limit is None:
        return -math.inf, math.inf, 0.0
    effort = value(limit, "effort")
    value(limit, "velocity")
    if kind not in LIMITED:
        return -math.inf, math.inf, effort
    lower, upper = value(limit, "lower", "0"), value(limit, "upper", "0")
    if lower > upper:
        raise fault(limit, f"must have lower at most upper, not {lower:g}, {upper:g}", "swap them")
    return lower, upper, effort


def read_shapes(link: Element) -> tuple[Shape, ...]:
    """The collision shapes of a link, posed in its frame."""
    return tuple(_read_shape(collision) for collision in link.findall("collision"))


def read_looks(link: Element) -> tuple[Shape, ...]:
    """What is seen of a link, posed in its frame: its collision shapes where that is a mesh."""
    seen = link.findall("visual")
    try:
        return tuple(map(_read_shape, seen)) or read_shapes(link)
    except InputError:  # no robot is refused for its looks
        return read_shapes(link)


def _read_shape(collision: Element) -> Shape:
    geometry = needed(collision, "geometry")
    if len(geometry) != 1 or geometry[0].tag not in ("box", "cylinder", "sphere"):
        found = " and ".join(f"<{e.tag!s}>" for e in geometry) or "nothing"
        rule = "must contain one box, cylinder or sphere"
        raise fault(geometry, f"{rule}, not {found}", "make the part of such collision shapes")
    shape = geometry[0]
    if shape.tag == "box":
        size = values(shape, "size", 3)
    else:
        names = ("radius", "length") if shape.tag == "cylinder" else ("radius",)
        size = [value(shape, name) for name in names]
    if min(size) <= 0:
        raise fault(shape, f"must have lengths above 0 m, not {size}", "correct them")
    return Shape(str(shape.tag), tuple(size), read_origin(collision))
