"""How a robot is driven: from the command (speed, steering) to what each of its joints does."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

from evoros.errors import POSITIVE, InputError, Rule, check
from evoros.types import Array
from evoros.urdf import Joint, Urdf

ALIGNMENT_M = 1e-3
"""Wheels that should lie opposite each other, or on the ground, may be this far off."""

_PAIR = Rule(
    "a list of two joint names, left and right",
    lambda v: (
        isinstance(v, list | tuple)
        and len(v) == 2
        and all(isinstance(name, str) and name for name in v)
        and v[0] != v[1]
    ),
)


class Drive(Protocol):
    """A drive whose geometry is known: what simulators and controllers need of it."""

    @property
    def max_speed_mps(self) -> float:
        """Greatest speed [m/s] of the point at ``turning_x_m``."""
        ...

    @property
    def steering_limit(self) -> float:
        """Full lock: the greatest steering angle [rad] of the bicycle model."""
        ...

    @property
    def wheelbase_m(self) -> float:
        """Of the bicycle model: curvature = tan(steering) / wheelbase."""
        ...

    @property
    def turning_x_m(self) -> float:
        """Where on the robot's x axis the point lies that moves at the commanded speed."""
        ...

    @property
    def steering_joints(self) -> tuple[str, ...]:
        """Controlled by position."""
        ...

    @property
    def wheel_joints(self) -> tuple[str, ...]:
        """Controlled by velocity; their links touch the ground."""
        ...

    def targets(self, speed: float, steering: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Angles [rad] of the steering joints, rates [rad/s] of the wheel joints."""
        ...


@runtime_checkable
class DriveDescription(Protocol):
    """Names the joints of a drive; their geometry is read from the robot's URDF."""

    def fit(self, urdf: Urdf) -> Drive:
        """The drive on this robot.

        Raises:
            InputError: a joint is missing, or its geometry is not that of such a drive.
        """
        ...


@dataclass(frozen=True)
class Ackermann:
    """Four wheels on two axles, the front ones steered so that no wheel slips.

    All axles meet in the instant centre of rotation, which lies on the rear axle's line at the
    distance ``wheelbase / tan(steering)`` to the left of the rear axle's centre. Every wheel is
    perpendicular to its line to that centre and rolls as fast as it is far from it.
    """

    steering_joints: tuple[str, ...]  # front left, front right
    wheel_joints: tuple[str, ...]  # front left, front right, rear left, rear right
    wheelbase_m: float
    kingpin_track_m: float  # between the steering axes
    front_track_m: float  # between the centres of the front wheels, straight ahead
    rear_track_m: float
    wheel_radius_m: float
    turning_x_m: float  # of the rear axle, in the robot's frame
    steering_limit_rad: float  # of each front wheel
    max_speed_mps: float

    def __post_init__(self) -> None:
        positive = "wheelbase_m kingpin_track_m front_track_m rear_track_m wheel_radius_m"
        for name in (*positive.split(), "steering_limit_rad", "max_speed_mps"):
            check(self, **{name: POSITIVE})

    @cached_property
    def steering_limit(self) -> float:
        """The bicycle model's angle [rad] at which the inner wheel reaches its limit."""
        tangent = math.tan(self.steering_limit_rad)
        length = self.wheelbase_m
        return math.atan(length * tangent / (length + 0.5 * self.kingpin_track_m * tangent))

    def targets(self, speed: float, steering: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Angles [rad] of (left, right); rates [rad/s] of (front left, front right, rear ...).

        ``speed`` [m/s] of the rear axle's centre and ``steering`` [rad] of the bicycle model are
        clipped to what the rover can do. The curvature, not the radius, is the variable: it is
        0, not infinite, straight ahead.
        """
        most, limit = self.max_speed_mps, self.steering_limit
        rate = min(max(speed, -most), most) / self.wheel_radius_m
        tangent = math.tan(min(max(steering, -limit), limit))  # = curvature * wheelbase
        curvature = tangent / self.wheelbase_m
        kingpin = 0.5 * self.kingpin_track_m * curvature
        offset = 0.5 * (self.front_track_m - self.kingpin_track_m) * curvature
        rear = 0.5 * self.rear_track_m * curvature
        angle = self.steering_limit_rad  # the limit is met exactly, whatever is rounded
        left = min(max(math.atan(tangent / (1.0 - kingpin)), -angle), angle)
        right = min(max(math.atan(tangent / (1.0 + kingpin)), -angle), angle)
        return (left, right), (
            rate * (math.sqrt((1.0 - kingpin) * (1.0 - kingpin) + tangent * tangent) - offset),
            rate * (math.sqrt((1.0 + kingpin) * (1.0 + kingpin) + tangent * tangent) + offset),
            rate * (1.0 - rear),
            rate * (1.0 + rear),
        )


@dataclass(frozen=True)
class AckermannDescription:
    """Which joints of a robot form an Ackermann drive, and its limits."""

    steering_joints: Sequence[str]  # left, right: revolute, about the vertical axis
    front_wheel_joints: Sequence[str]  # left, right: continuous, about the axis to the left
    rear_wheel_joints: Sequence[str]  # left, right: continuous, about the axis to the left
    steering_limit_rad: float  # of each front wheel
    max_speed_mps: float  # of the rear axle's centre

    def __post_init__(self) -> None:
        check(
            self,
            steering_joints=_PAIR,
            front_wheel_joints=_PAIR,
            rear_wheel_joints=_PAIR,
            steering_limit_rad=Rule(
                "a number greater than 0 and less than pi/2",
                lambda v: POSITIVE.holds(v) and v < 0.5 * math.pi,
            ),
            max_speed_mps=POSITIVE,
        )

    def fit(self, urdf: Urdf) -> Ackermann:
        """The drive with the wheelbase, tracks and radius of this robot.

        Raises:
            InputError: a joint is missing, of another type, or does not fit the geometry.
        """
        wheels = tuple(self.front_wheel_joints) + tuple(self.rear_wheel_joints)
        for name in self.steering_joints:
            joint = urdf.joint(name, "revolute")
            _require_axis(urdf, joint, 2, "0 0 1")
            if joint.upper < self.steering_limit_rad or -joint.lower < self.steering_limit_rad:
                raise urdf.fault(
                    f"joint {name}",
                    f"its limits {joint.lower:g} .. {joint.upper:g} rad must hold "
                    f"+-{self.steering_limit_rad:g} rad",
                    "widen them or lower steering_limit_rad",
                )
        for name, steering in zip(self.front_wheel_joints, self.steering_joints, strict=True):
            above = [joint.name for joint in urdf.above(urdf.joint(name, "continuous").child)]
            if steering not in above:
                raise urdf.fault(f"joint {name}", f"must hang on {steering}", "swap the names")
        radius = wheel_radius(urdf, wheels)
        kingpin_x, kingpin_track = _axle(urdf, self.steering_joints)
        front_x, front_track = _axle(urdf, self.front_wheel_joints)
        rear_x, rear_track = _axle(urdf, self.rear_wheel_joints)
        if abs(kingpin_x - front_x) > ALIGNMENT_M or front_x <= rear_x:
            raise urdf.fault(
                "drive",
                f"the front wheels (x = {front_x:g}) must be on their steering axes "
                f"(x = {kingpin_x:g}), ahead of the rear wheels (x = {rear_x:g})",
                "correct the origins of the joints or their names",
            )
        return Ackermann(
            steering_joints=tuple(self.steering_joints),
            wheel_joints=wheels,
            wheelbase_m=front_x - rear_x,
            kingpin_track_m=kingpin_track,
            front_track_m=front_track,
            rear_track_m=rear_track,
            wheel_radius_m=radius,
            turning_x_m=rear_x,
            steering_limit_rad=float(self.steering_limit_rad),
            max_speed_mps=float(self.max_speed_mps),
        )


def _require_axis(urdf: Urdf, joint: Joint, index: int, text: str) -> None:
    if urdf.axis(joint)[index] < 1.0 - 1e-6:
        raise urdf.fault(
            f"joint {joint.name}", f"its axis must point along {text} of the robot", "turn it"
        )


def _axle(urdf: Urdf, pair: Sequence[str]) -> tuple[float, float]:
    """x [m] and track [m] of two joints that must lie opposite each other, left then right."""
    left, right = (_place(urdf, name) for name in pair)
    if abs(left[0] - right[0]) > ALIGNMENT_M or abs(left[1] + right[1]) > ALIGNMENT_M:
        raise urdf.fault(
            f"joints {pair[0]} and {pair[1]}",
            f"must lie opposite each other, not at ({left[0]:g}, {left[1]:g}) and "
            f"({right[0]:g}, {right[1]:g})",
            "correct their origins",
        )
    if left[1] <= right[1]:
        raise urdf.fault(f"joint {pair[0]}", "must be the left one", "swap the two names")
    return float(0.5 * (left[0] + right[0])), float(left[1] - right[1])


def _place(urdf: Urdf, name: str) -> Array:
    place: Array = urdf.poses[urdf.joint(name, "revolute", "continuous").child][:3, 3]
    return place


def wheel_radius(urdf: Urdf, joints: Sequence[str]) -> float:
    """The common radius [m] of these wheels, which stand on the ground and roll forward.

    Raises:
        InputError: a wheel has no round collision shape, another radius, or is off the ground.
    """
    radii = []
    for name in joints:
        joint = urdf.joint(name, "continuous")
        _require_axis(urdf, joint, 1, "0 1 0")
        shapes = urdf.collisions[joint.child]
        if len(shapes) != 1 or shapes[0].kind == "box":
            raise urdf.fault(
                f"link {joint.child}",
                "a wheel must have one collision shape, a cylinder or a sphere",
                "correct its <collision>",
            )
        radii.append(shapes[0].size[0])
        height = float(shapes[0].pose[2, 3])
        if abs(height - radii[-1]) > ALIGNMENT_M:
            raise urdf.fault(
                f"link {joint.child}",
                f"a wheel of radius {radii[-1]:g} m must be centred as high above the root link's "
                f"origin, which is on the ground, not {height:g} m",
                "correct the origins of the joints",
            )
    if max(radii) - min(radii) > ALIGNMENT_M:
        raise InputError(f"{urdf.source}: wheels must be equally large, not {radii}; equal them")
    return float(sum(radii) / len(radii))
