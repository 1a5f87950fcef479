"""Builds and changes elements of a URDF."""

from collections.abc import Sequence

from lxml import etree
from lxml.etree import SubElement
from lxml.etree import _Element as Element

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.linear import principal_axes
from evoros.geometry.shapes import Pose, Shape


def set_origin(element: Element, pose: Pose) -> None:
    """Replace the ``<origin>`` of an element."""
    for origin in element.findall("origin"):
        element.remove(origin)
    rotation = pose.rotation
    pitch = elementary.asin(min(max(-float(rotation[2, 0]), -1.0), 1.0))
    if abs(rotation[2, 0]) < 1.0 - 1e-12:
        roll = elementary.atan2(rotation[2, 1], rotation[2, 2])
        yaw = elementary.atan2(rotation[1, 0], rotation[0, 0])
    else:  # roll and yaw turn about the same axis
        roll, yaw = 0.0, elementary.atan2(-rotation[0, 1], rotation[1, 1])
    xyz = " ".join(repr(float(coordinate)) for coordinate in pose.position)
    rpy = f"{roll!r} {pitch!r} {yaw!r}"
    element.insert(0, etree.Element("origin", xyz=xyz, rpy=rpy))


def build_collision(shape: Shape) -> Element:
    """Build the ``<collision>`` of a shape, which is posed in the frame of its link.

    A convex polyhedron becomes a ``<convex>``, which only this package reads.
    """
    collision = etree.Element("collision")
    geometry = SubElement(collision, "geometry")
    numbers = [repr(float(length)) for length in shape.size]
    if shape.kind == "convex":
        corners = " ".join(repr(float(x)) for corner in shape.corners for x in corner)
        SubElement(geometry, "convex", corners=corners)
    elif shape.kind == "box":
        SubElement(geometry, "box", size=" ".join(numbers))
    else:
        names = ("radius", "length")[: len(numbers)]
        SubElement(geometry, shape.kind, dict(zip(names, numbers, strict=True)))
    set_origin(collision, shape.pose)
    return collision


def set_collisions(link: Element, shapes: Sequence[Shape]) -> None:
    """Replace the collision shapes of a link."""
    for collision in link.findall("collision"):
        link.remove(collision)
    link.extend([build_collision(shape) for shape in shapes])


def set_inertial(link: Element, mass: float, centre: Array, tensor: Array) -> None:
    """Replace the ``<inertial>`` of a link: mass [kg], centre (3,) [m], tensor (3, 3) [kg m2]."""
    for inertial in link.findall("inertial"):
        link.remove(inertial)
    moments, axes = principal_axes(tensor)
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "mass", value=repr(mass))
    xx, yy, zz = (repr(moment) for moment in moments.tolist())
    SubElement(inertial, "inertia", ixx=xx, iyy=yy, izz=zz, ixy="0", ixz="0", iyz="0")
    set_origin(inertial, Pose.from_matrix(centre.tolist(), axes))


def fix_joint(joint: Element) -> None:
    """Make a joint fixed, at its zero position."""
    joint.set("type", "fixed")
    for element in [child for child in joint if child.tag not in ("origin", "parent", "child")]:
        joint.remove(element)


def set_motor(joint: Element, kind: str, axis: Array, effort: float, velocity: float) -> None:
    """Make a joint turn about ``axis`` (3,), with a maximum torque [N m] and rate [rad/s]."""
    joint.set("type", kind)
    for element in [*joint.findall("axis"), *joint.findall("mimic")]:
        joint.remove(element)
    SubElement(joint, "axis", xyz=" ".join(repr(float(x)) for x in axis))
    limit = require_limit(joint)
    limit.set("effort", repr(effort))
    limit.set("velocity", repr(velocity))


def add_fixed_joint(root: Element, name: str, parent: str, child: str, pose: Pose) -> None:
    """Fix a link to another; ``pose`` places the child's frame in the parent's."""
    joint = SubElement(root, "joint", name=name, type="fixed")
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    set_origin(joint, pose)


def add_fixed_link(root: Element, name: str, parent: str, pose: Pose) -> Element:
    """Add an empty link on a fixed joint; ``pose`` is in the frame of ``parent``."""
    link = SubElement(root, "link", name=name)
    add_fixed_joint(root, f"{name}_joint", parent, name, pose)
    return link


def require_limit(joint: Element) -> Element:
    """Return the ``<limit>`` of a joint, which gets one if it has none."""
    limit = joint.find("limit")
    return SubElement(joint, "limit") if limit is None else limit
