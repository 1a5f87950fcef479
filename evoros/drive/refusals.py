"""Refuses drives that look like another: wheels that go sideways, and wheels that only steer."""

import math
import re
from collections.abc import Sequence

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.base.linear import length, product
from evoros.drive.candidates import NEARLY_ALIGNED, TURNING, Candidate, find_misaligned, pair_up
from evoros.drive.wheels import LEFT, UP
from evoros.formats.urdf.parts import Joint
from evoros.formats.urdf.tree import Plugin, Urdf

_KINDS = {
    "mecanum": re.compile(r"mecanum", re.IGNORECASE),
    "omni": re.compile(r"omni(?!vision)", re.IGNORECASE),
}
_SIDEWAYS_PLUGIN = re.compile(r"planar_?move|mecanum|omni|holonomic", re.IGNORECASE)
_MIN_ROLLERS = 3  # joints that turn on a wheel
_DIAGONAL = (elementary.cos(math.radians(60.0)), elementary.cos(math.radians(30.0)))
"""The range of the cosine between the axle of a mecanum wheel and <fdir1>."""


def refuse_sideways(urdf: Urdf, wheels: Sequence[Candidate]) -> None:
    """Refuse a robot whose wheels, rollers or plugin also move it sideways.

    Raises:
        InputError: it does; the error names the joints and the drive to choose knowingly.
    """
    # A plugin that moves one pair of wheels sideways, steered or not, is a convenience of Gazebo.
    pairs = len(_pair_up_unsteered(wheels))
    turning = [joint for joint in urdf.joints.values() if joint.type in TURNING]
    joints = [wheel.joint for wheel in wheels] if pairs else turning
    reason = next(filter(None, (_find_rollers(urdf, joint) for joint in joints)), "")
    if not reason and pairs != 1:
        reason = _name_sideways_plugin(urdf.plugins)
    if reason:
        kind = _choose_kind(wheels)
        names = ", ".join(joint.name for joint in joints) or "none that turn"
        raise urdf.error(
            f"the robot also goes sideways ({reason}), and no drive here does; wheels: {names}",
            f"set robot.drive.kind={kind} to drive it on plain wheels in their place"
            if kind
            else "write a drive of its own (docs/parts/drive.md)",
        )


def refuse_misaligned(urdf: Urdf, wheels: Sequence[Candidate]) -> None:
    """Refuse a robot with wheels on joints that point elsewhere than across it."""
    joints = find_misaligned(urdf, wheels)
    if joints:
        raise misaligned_error(urdf, joints, _choose_kind(wheels))


def misaligned_error(urdf: Urdf, joints: Sequence[Joint], kind: str = "") -> InputError:
    """Create the error for wheels on joints that do not point across the robot.

    ``kind`` is the drive that the other wheels form.
    """
    names = ", ".join(joint.name for joint in joints)
    if all(abs(float(urdf.axis_of(joint)[UP])) > NEARLY_ALIGNED for joint in joints):
        held = f", or hold it straight with robot.drive.kind={kind}" if kind else ""
        return urdf.error(
            f"a joint that turns its wheel about the vertical steers it, so the wheel does not "
            f"roll: {names}",
            "hang the wheel on another joint below it, with the axis to the left (y), and name "
            f"both with drive@robot.drive=ackermann{held}",
        )
    cosines = [min(abs(float(urdf.axis_of(joint)[LEFT])), 1.0) for joint in joints]
    angles = ", ".join(f"{math.degrees(elementary.acos(cosine)):.0f}" for cosine in cosines)
    return urdf.error(
        f"the axis of a wheel must point to the left (y), not {angles} deg away: {names}",
        "turn its <axis> or its <origin>; a joint that steers belongs into "
        "robot.drive.steering_joints, and no drive here has omni wheels",
    )


def _find_rollers(urdf: Urdf, joint: Joint) -> str:
    """Return why a wheel is one with rollers; an empty text if it is a plain wheel."""
    group = urdf.rigid_group(joint.child)
    names = [joint.name, *group, *(mesh for link in group for mesh in urdf.meshes.get(link, ()))]
    for kind, pattern in _KINDS.items():
        named = next(filter(pattern.search, names), "")
        if named:
            return f"{kind} wheels, as {named!r} says"
    rollers = [j for link in group for j in urdf.children_of(link) if j.type in TURNING]
    if len(rollers) >= _MIN_ROLLERS:
        return f"wheels with rollers, of which {joint.child!r} has {len(rollers)}"
    return ""


def find_diagonal(urdf: Urdf, wheels: Sequence[Candidate]) -> list[str]:
    """Return the joints of wheels that Gazebo gives the friction of rollers at 45 deg.

    Some robots on plain wheels have it, too, because they turn better with it in Gazebo.
    """
    joints = [wheel.joint for wheel in wheels]
    return [
        joint.name
        for joint in joints
        if any(_is_diagonal(urdf, link, joint) for link in urdf.rigid_group(joint.child))
    ]


def _is_diagonal(urdf: Urdf, link: str, joint: Joint) -> bool:
    if link not in urdf.friction_axes:
        return False
    direction, frame = urdf.friction_axes[link]
    pose = urdf.poses.get(frame or link)
    size = length(np.array(direction))
    if pose is None or size == 0.0:
        return False
    along: Array = product(pose.rotation, np.array(direction)) / size
    low, high = _DIAGONAL
    return low < abs(float(product(along, urdf.axis_of(joint)))) < high


def _name_sideways_plugin(plugins: Sequence[Plugin]) -> str:
    """Return the plugin that moves the robot sideways; an empty text if none does."""
    for plugin in plugins:
        files = [text.rpartition("/")[2] for text in plugin.texts.get("parameters", ())]
        for name in filter(_SIDEWAYS_PLUGIN.search, [*plugin.name.split(), *files]):
            return f"Gazebo's plugin {name}"
    return ""


def _pair_up_unsteered(wheels: Sequence[Candidate]) -> list[tuple[Candidate, Candidate]]:
    return pair_up([wheel for wheel in wheels if wheel.steering is None])


def _choose_kind(wheels: Sequence[Candidate]) -> str:
    """Return the drive that the wheels would form if they were plain ones."""
    pairs = len(_pair_up_unsteered(wheels))
    return ("", "differential")[pairs] if pairs < 2 else "skid_steer"
