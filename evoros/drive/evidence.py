"""Finds signs in a robot file that wheels move vertically together, slide, or have rollers."""

import math
import re
from collections.abc import Collection, Sequence

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array, length, product
from evoros.drive.candidates import NEARLY_ALIGNED, TURNING, find_candidates
from evoros.drive.protocol import LEFT
from evoros.drive.rolling import Candidate
from evoros.formats.urdf.parts import Joint
from evoros.formats.urdf.tree import Plugin, Urdf

_KINDS = {
    "mecanum": re.compile(r"mecanum", re.IGNORECASE),
    "omni": re.compile(r"omni(?!vision)", re.IGNORECASE),
}
PUSHING_PLUGIN = re.compile(r"(planar|force_?based)_?move", re.IGNORECASE)
_SIDEWAYS_PLUGIN = re.compile(
    rf"{PUSHING_PLUGIN.pattern}|mecanum|holonomic|omni_?(base|control|dir|drive|wheel)",
    re.IGNORECASE,
)
_MIN_ROLLERS = 3  # minimum number of rotating joints on a wheel with rollers
_DIAGONAL = (elementary.cos(math.radians(60.0)), elementary.cos(math.radians(30.0)))
"""Range of the |cosine| of the angle between a mecanum wheel's axle and <fdir1>."""


def find_bogies(urdf: Urdf, wheels: Sequence[Candidate]) -> list[str]:
    """Return the joints on which two or more wheels of one side rise and sink together."""
    carried: dict[str, list[Candidate]] = {}
    for wheel in wheels:
        for joint in list(urdf.joints_above(wheel.joint.child))[1:]:
            if joint.type in TURNING and abs(float(urdf.axis_of(joint)[LEFT])) > NEARLY_ALIGNED:
                carried.setdefault(joint.name, []).append(wheel)
    return [n for n, group in carried.items() if len(group) > len({w.y > 0.0 for w in group}) == 1]


def find_rollers(urdf: Urdf, joint: Joint) -> str:
    """Return the evidence that a wheel has rollers, or ""."""
    group = urdf.rigid_group(joint.child)
    names = [joint.name, *group, *(mesh for link in group for mesh in urdf.meshes.get(link, ()))]
    if kind := read_kind(names):
        return kind
    rollers = [j for link in group for j in urdf.children_of(link) if j.type in TURNING]
    if len(rollers) >= _MIN_ROLLERS:
        return f"wheels with rollers: {joint.child!r} has {len(rollers)}"
    return ""


def read_kind(names: Sequence[str]) -> str:
    """Return the kind of wheels stated in a name, or ""."""
    for kind, pattern in _KINDS.items():
        named = next(filter(pattern.search, names), "")
        if named:
            return f"{kind} wheels, according to the name {named!r}"
    return ""


def find_diagonal(urdf: Urdf, wheels: Sequence[Candidate]) -> list[str]:
    """Return the joints of wheels with a friction axis at 45 deg in Gazebo, as with rollers."""
    # Some robots with plain wheels use this setting as well, to turn better in Gazebo.
    joints = (wheel.joint for wheel in wheels)
    groups = ((joint, urdf.rigid_group(joint.child)) for joint in joints)
    return [j.name for j, group in groups if any(_is_diagonal(urdf, link, j) for link in group)]


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


def slides(urdf: Urdf, joint: Joint) -> bool:
    """Return True if a wheel is frictionless in Gazebo."""
    return not urdf.slippery.isdisjoint(urdf.rigid_group(joint.child))


def find_dragged(urdf: Urdf, driven: Collection[str]) -> list[Candidate]:
    """Find unsteered wheels that grip in Gazebo, without the wheels on the joints ``driven``."""
    return [
        wheel
        for wheel in find_candidates(urdf)
        if wheel.turns and wheel.steering is None and not slides(urdf, wheel.joint)
        if wheel.joint.name not in driven
    ]


def name_sideways_plugin(plugins: Sequence[Plugin]) -> str:
    """Return the Gazebo plugin that moves the robot sideways, or ""."""
    for plugin in plugins:
        files = [text.rpartition("/")[2] for text in plugin.texts.get("parameters", ())]
        for name in filter(_SIDEWAYS_PLUGIN.search, [*plugin.name.split(), *files]):
            return name
    return ""
