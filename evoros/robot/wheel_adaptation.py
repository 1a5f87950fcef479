"""Adapts a robot's wheels and steering joints to the form that drives require."""

import math
from collections import defaultdict

import numpy as np
from lxml.etree import _Element as Element

from evoros.base import elementary
from evoros.base.arrays import Array, length, product
from evoros.drive.automatic import misaligned_error
from evoros.drive.candidates import ALIGNED, NEARLY_ALIGNED, TURNING
from evoros.drive.protocol import LEFT, UP, tolerated
from evoros.drive.rolling import Wheel, group_shapes, measure_wheel
from evoros.formats.strict_xml import require_child
from evoros.formats.urdf.elements import set_collisions, set_motor
from evoros.formats.urdf.parts import Joint
from evoros.formats.urdf.tree import Urdf
from evoros.geometry.shapes import Pose, Shape

_SAME = 1.0 - 1e-6  # minimum cosine of the angle between axes treated as equal
# Beyond 0.14 mrad, as with 1.57 for half of pi, a rigid wheel stands on one edge of its tread.
_STRAIGHT = 1.0 - 1e-8
MOTOR_VELOCITY = 100.0  # [rad/s], maximum velocity limit of a joint


Assumptions = defaultdict[str, list[str]]  # joints and links by assumption about them
_REVERSED = "joint axes that point right or down are reversed"


def adapt_wheel(
    elements: Element, urdf: Urdf, name: str, fixed: bool, named: bool, notes: Assumptions
) -> Wheel:
    """Point a joint's axis left, and make its wheel a single cylinder; return the wheel.

    If ``fixed``, a fixed joint is accepted and made continuous; if ``named``, an axis in any
    direction is accepted. The returned wheel is in the root's frame.
    """
    joint = urdf.find_joint(name, *TURNING, *(("fixed",) if fixed else ()))
    rotation, shapes = urdf.poses[joint.child].rotation, group_shapes(urdf, joint.child)
    if not shapes:
        problem = f"wheel {joint.child!r} must have a <collision> or a <visual>"
        raise urdf.error(problem, "add a <collision> with a cylinder")
    axis = _point_left(urdf, joint, named, notes)
    wheel = measure_wheel(shapes, axis)
    offset = float(length(wheel.centre - float(product(wheel.centre, axis)) * axis))
    if offset > tolerated(wheel.radius):
        problem = f"wheel {joint.child!r} must be centred on its joint, not {offset:g} m away"
        raise urdf.error(problem, "move the <origin> of its shape onto the joint's axis")
    element = find_joint(elements, name)
    for mimic in element.findall("mimic"):
        element.remove(mimic)
        notes["wheels that mimic another joint get their own motor"].append(name)
    if math.isfinite(joint.upper - joint.lower):
        stops = f"{name} (from {joint.lower:g} to {joint.upper:g} rad)"
        notes["stops in the joints of wheels are ignored"].append(stops)
    along = _align(urdf, joint, axis)
    if along < _STRAIGHT:
        _reshape(elements, urdf, joint, wheel, axis)
    if along < _SAME:
        notes["wheels are replaced with one cylinder each"].append(joint.child)
    if joint.type != "continuous" or not np.array_equal(axis, joint.axis):
        _rewrite(elements, joint, "continuous", axis)
    centre: Array = product(rotation, wheel.centre) + urdf.poses[joint.child].position
    return wheel._replace(centre=centre)


def _point_left(urdf: Urdf, joint: Joint, named: bool, notes: Assumptions) -> Array:
    """Return the axis (3,), in the link's frame, that points to the robot's left."""
    rotation = urdf.poses[joint.child].rotation
    left: Array = rotation.T[:, LEFT]
    if joint.type == "fixed":
        return left
    along = float(urdf.axis_of(joint)[LEFT])
    if along < -ALIGNED:
        notes[_REVERSED].append(joint.name)
    if abs(along) > _STRAIGHT:
        return joint.axis if along > 0.0 else -joint.axis
    if abs(along) < NEARLY_ALIGNED and not named:
        raise misaligned_error(urdf, [joint], "correct the <axis> or the <origin>")
    _tell_straightened(joint, along, notes)
    return left


def _tell_straightened(joint: Joint, along: float, notes: Assumptions) -> None:
    if abs(along) < 1.0 - 4e-5:  # half a degree
        angle = math.degrees(elementary.acos(abs(along)))
        text = "skewed axes of wheels and steering joints are straightened"
        notes[text].append(f"{joint.name} ({angle:.1f} deg)")


def _align(urdf: Urdf, joint: Joint, axis: Array) -> float:
    """Return the |cosine| of the angle from ``axis`` to the axis of a single round shape, or 0."""
    shapes = urdf.shapes[joint.child]
    if len(shapes) != 1 or len(group_shapes(urdf, joint.child)) != 1:
        return 0.0
    if shapes[0].kind == "cylinder":
        return abs(float(product(shapes[0].pose.rotation[:, 2], axis)))
    return float(shapes[0].kind == "sphere")


def _reshape(elements: Element, urdf: Urdf, joint: Joint, wheel: Wheel, axis: Array) -> None:
    links = {str(link.get("name")): link for link in elements.findall("link")}
    for name in urdf.rigid_group(joint.child):
        set_collisions(links[name], ())
    place = float(product(wheel.centre, axis)) * axis
    x = np.cross(np.eye(3)[int(np.abs(axis).argmin())], axis)
    x /= length(x)
    frame = np.stack([x, np.cross(axis, x), axis], axis=1)
    pose = Pose.from_matrix(place.tolist(), frame)
    cylinder = Shape("cylinder", (wheel.radius, max(wheel.width, 1e-3)), pose)
    set_collisions(links[joint.child], (cylinder,))


def adapt_steering(
    elements: Element, urdf: Urdf, name: str, fixed: bool, stop: float, notes: Assumptions
) -> None:
    """Make positive angles of a joint steer left, limited to ``stop`` [rad] if it has no limits."""
    joint = urdf.find_joint(name, *TURNING, *(("fixed",) if fixed else ()))
    rotation = urdf.poses[joint.child].rotation
    up: Array = rotation.T[:, UP]
    along = 1.0 if joint.type == "fixed" else float(urdf.axis_of(joint)[UP])
    if abs(along) < NEARLY_ALIGNED:
        problem = f"joint {name!r} must have a vertical axis (z)"
        raise urdf.error(problem, "rotate its <axis> or <origin>")
    _tell_straightened(joint, along, notes)
    lower, upper = joint.lower, joint.upper
    stated = find_joint(elements, name).find("limit")
    ends = [] if stated is None else [float(stated.get(name, "0")) for name in ("lower", "upper")]
    if stated is not None and joint.type == "revolute" and ends[0] > ends[1]:
        text = "swapped lower and upper limits of steering joints are put in order"
        notes[text].append(f"{name} (to {lower:g} and {upper:g})")
        _set_bounds(stated, lower, upper)
    if along < 0.0:
        lower, upper = -upper, -lower
        notes[_REVERSED].append(name)
    limited = math.isfinite(upper - lower)
    if not limited:
        lower, upper = max(lower, -stop), min(upper, stop)
        notes[f"steering joints without limits stop at {stop:g} rad"].append(name)
    if limited and max(upper, -lower) > math.pi + 0.01:
        text = "steering limits exceed half a turn and may be in degrees"
        notes[text].append(f"{name} (from {lower:g} to {upper:g})")
    if limited and along > _SAME:
        return
    keeps = joint.type != "fixed" and abs(along) > _SAME
    axis = math.copysign(1.0, along) * joint.axis if keeps else up
    limit = require_child(_rewrite(elements, joint, "revolute", axis), "limit")
    _set_bounds(limit, lower, upper)


def _set_bounds(limit: Element, lower: float, upper: float) -> None:
    limit.set("lower", repr(lower))
    limit.set("upper", repr(upper))


def _rewrite(elements: Element, joint: Joint, kind: str, axis: Array) -> Element:
    element = find_joint(elements, joint.name)
    set_motor(element, kind, axis, joint.effort, min(joint.velocity, MOTOR_VELOCITY))
    return element


def find_joint(elements: Element, name: str) -> Element:
    """Return the element of an existing joint."""
    return next(joint for joint in elements.findall("joint") if joint.get("name") == name)
