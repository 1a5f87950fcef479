"""Finds the wheels and steering joints of a robot by their shapes, places and names."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from evoros.base import elementary
from evoros.drive.rolling import Wheel, group_shapes, measure_wheel
from evoros.drive.wheels import CASTER_GAP_M, LEFT, UP, tolerated
from evoros.formats.urdf.parts import Joint
from evoros.formats.urdf.tree import Urdf

ALIGNED = elementary.cos(math.radians(5.0))
"""The cosine between two axes that are taken as the same."""

NEARLY_ALIGNED = elementary.cos(math.radians(20.0))
"""The cosine between the axis of a wheel and the robot's lateral axis below which it is none."""

TURNING = ("continuous", "revolute")

CASTER = re.compile(r"caster|castor|swivel|omni|ball", re.IGNORECASE)
_OMNI = re.compile(r"omni", re.IGNORECASE)
_WHEEL = re.compile(r"wheel|whl|tire|tyre|hub(?!cap)", re.IGNORECASE)
_STEERING = re.compile(r"steer|hinge|knuckle|kingpin|ackermann", re.IGNORECASE)
_MAX_LACK = 0.15  # of roundness, of a part that may be a wheel
_MIN_RADIUS_M = 0.01


@dataclass(frozen=True, eq=False)
class Candidate:
    """A joint whose child link looks like a wheel on the ground."""

    joint: Joint
    wheel: Wheel  # in the root's frame
    turns: bool  # the joint is not fixed
    steering: Joint | None  # that turns it about the vertical

    @property
    def x(self) -> float:
        """Where it is along the robot [m]."""
        return float(self.wheel.centre[0])

    @property
    def y(self) -> float:
        """Where it is across the robot [m], left positive."""
        return float(self.wheel.centre[1])


def find_candidates(urdf: Urdf) -> list[Candidate]:
    """Return all parts that look like wheels and stand on the ground, casters excepted."""
    candidates: dict[str, Candidate] = {}
    for joint in urdf.joints.values():
        above = list(urdf.joints_above(joint.child))
        if _is_caster(urdf, joint, above):
            continue
        turns, along = joint.type in TURNING, abs(float(urdf.axis_of(joint)[LEFT]))
        likely = joint.type == "fixed" or (turns and along > NEARLY_ALIGNED)
        if (turns and along > ALIGNED) or (likely and _is_called_wheel(joint)):
            wheel = measure_link(urdf, joint.child)
            if wheel is not None and wheel.roundness < _MAX_LACK:
                steering = _find_steering(urdf, above[1:])
                candidates[joint.name] = Candidate(joint, wheel, turns, steering)
    outer = [c for c in candidates.values() if not _inside_another(urdf, c, candidates)]
    if not outer:
        return []
    turning = [c for c in outer if c.turns] or outer
    ground = min(c.wheel.bottom for c in turning)
    return [c for c in outer if abs(c.wheel.bottom - ground) < _reach(c.wheel)]


def find_misaligned(urdf: Urdf, wheels: Sequence[Candidate]) -> list[Joint]:
    """Return joints of parts that look like wheels on the ground and turn elsewhere than across.

    Spheres are left out, because they roll about every axis.
    """
    ground = min((wheel.wheel.bottom for wheel in wheels), default=None)
    misaligned = []
    for joint in urdf.joints.values():
        above = list(urdf.joints_above(joint.child))
        if joint.type not in TURNING or not _is_called_wheel(joint):
            continue
        if abs(float(urdf.axis_of(joint)[LEFT])) > NEARLY_ALIGNED or _is_caster(urdf, joint, above):
            continue
        wheel = measure_link(urdf, joint.child)
        carries = any(j.type in TURNING for j in urdf.children_of(joint.child))
        ball = all(shape.kind == "sphere" for shape, _ in group_shapes(urdf, joint.child))
        if wheel is None or carries or wheel.roundness > _MAX_LACK or ball:
            continue
        if ground is None or abs(wheel.bottom - ground) < _reach(wheel):
            misaligned.append(joint)
    return misaligned


def _is_called_wheel(joint: Joint) -> bool:
    return bool(_WHEEL.search(joint.name) or _WHEEL.search(joint.child))


def _is_caster(urdf: Urdf, joint: Joint, above: Sequence[Joint]) -> bool:
    """Return whether a part or what carries it is called a caster; driven omni wheels are none."""
    driven = joint.name in urdf.actuated
    names = [name for j in above for name in (j.name, j.child)]
    return any(CASTER.search(_OMNI.sub("", name) if driven else name) for name in names)


def _reach(wheel: Wheel) -> float:
    return max(CASTER_GAP_M, 2.0 * tolerated(wheel.radius))


def measure_link(urdf: Urdf, link: str) -> Wheel | None:
    """Measure a link about the robot's lateral axis; None if it has no shape of some size."""
    pose = urdf.poses[link]
    shapes = [(shape, pose @ local) for shape, local in group_shapes(urdf, link)]
    if not shapes:
        return None
    wheel = measure_wheel(shapes, np.array([0.0, 1.0, 0.0]))
    return wheel if wheel.radius > _MIN_RADIUS_M else None


def _find_steering(urdf: Urdf, above: Sequence[Joint]) -> Joint | None:
    """Find the joint that steers a wheel: one about the vertical, or one that is called so."""
    for joint in above:
        if joint.type in TURNING and abs(float(urdf.axis_of(joint)[UP])) > ALIGNED:
            return joint
    for joint in above:
        if joint.type == "fixed" and _STEERING.search(f"{joint.name} {joint.child}"):
            return joint
    return None


def _inside_another(urdf: Urdf, candidate: Candidate, others: Mapping[str, Candidate]) -> bool:
    """Return whether another candidate is the wheel that a candidate belongs to.

    Of turning joints above each other the last one counts, of fixed ones the first, and turning
    ones come before fixed ones.
    """
    above = list(urdf.joints_above(candidate.joint.child))[1:]
    for other in others.values():
        carried = other is not candidate and candidate.joint in urdf.joints_above(other.joint.child)
        if carried and other.turns:
            return True
    return not candidate.turns and any(joint.name in others for joint in above)


def pair_up(candidates: Sequence[Candidate]) -> list[tuple[Candidate, Candidate]]:
    """Return the pairs (left, right) that lie opposite each other, from the front to the rear."""
    left = [c for c in candidates if c.y > 0.0]
    right = [c for c in candidates if c.y <= 0.0]
    pairs = []
    for one in sorted(left, key=lambda c: -c.x):
        opposite = [c for c in right if _are_opposite(one, c)]
        if opposite:
            pairs.append((one, min(opposite, key=lambda c: abs(c.x - one.x))))
            right.remove(pairs[-1][1])
    return pairs


def _are_opposite(left: Candidate, right: Candidate) -> bool:
    reach = 2.0 * max(_reach(left.wheel), _reach(right.wheel))
    middle = abs(left.y + right.y) / 2.0
    return abs(left.x - right.x) < reach and middle < 0.25 * abs(left.y - right.y)
