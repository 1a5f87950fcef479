"""Ackermann steering: four wheels, two of which steer so that no wheel slips."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

import numpy as np

from evoros.base import elementary
from evoros.base.checks import NUMBER, POSITIVE, checked, invalid
from evoros.drive.candidates import default_speed
from evoros.drive.protocol import (
    ANGLE,
    LINKS,
    PAIR,
    UP,
    Axle,
    DriveDescription,
    check_caster,
    driven_joint,
    measure_axle,
    place_axle,
    tolerated,
)
from evoros.drive.rolling import Pair
from evoros.formats.urdf.tree import Urdf

DEFAULT_STEERING_RAD = 0.5  # default if steering joints have no limits
MAX_DEFAULT_STEERING_RAD = 0.8  # maximum default, even if steering joints can turn further


@dataclass(frozen=True)
@checked
class Ackermann:
    """A drive whose wheels all roll in circles about the intersection of the axle lines.

    This point is ``wheelbase / tan(steering)`` to the left of the middle of the fixed axle. The
    speed of each wheel is proportional to its distance from this point.
    """

    speed_limit_offset_m: ClassVar[float] = 0.0  # the limit applies to the middle of the fixed axle
    turn_ratio: ClassVar[float] = 1.0  # the wheels roll without slipping
    steering_joints: tuple[str, ...]  # left, right
    wheel_joints: tuple[str, ...]  # steered left, steered right, fixed left, fixed right
    wheelbase_m: Annotated[float, POSITIVE]
    kingpin_track_m: Annotated[float, POSITIVE]  # distance between the axes of the steering joints
    steered_track_m: Annotated[float, POSITIVE]  # track of the steered wheels at zero angle
    fixed_track_m: Annotated[float, POSITIVE]
    steered_radius_m: Annotated[float, POSITIVE]
    fixed_radius_m: Annotated[float, POSITIVE]
    rear_axle_x_m: Annotated[float, NUMBER]  # x of the turning point: fixed axle plus slide_m
    steering_stop_rad: Annotated[float, POSITIVE]  # mechanical limit of the steering joints
    steering_limit_rad: Annotated[float, ANGLE]  # permitted angle of each steering joint
    max_speed_mps: Annotated[float, POSITIVE]  # speed limit at the middle of the fixed axle
    caster_links: tuple[str, ...] = ()
    slide_m: Annotated[float, NUMBER] = 0.0  # [m] forward from the fixed axle to the turning point
    steers_rear: bool = False  # whether the rear wheels steer, as on forklifts

    def __post_init__(self) -> None:
        if self.steering_limit_rad > self.steering_stop_rad:
            rule = f"must be at most {self.steering_stop_rad:g}, where the steering joints stop"
            fix = "lower robot.drive.steering_limit_rad, or widen the <limit> of both joints"
            raise invalid(self, "steering_limit_rad", self.steering_limit_rad, rule, fix)

    @cached_property
    def steering_limit(self) -> float:
        """Full lock: bicycle-model angle [rad] at which the inner wheel reaches its limit."""
        tangent = elementary.tan(self.steering_limit_rad)
        length = self.wheelbase_m
        return elementary.atan(length * tangent / (length + 0.5 * self.kingpin_track_m * tangent))

    def targets(self, speed: float, steering: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return angles [rad] (left, right) and rates [rad/s] (steered left, right, fixed ...).

        The ``speed`` [m/s] of the fixed axle and the bicycle-model ``steering`` [rad] are clipped.
        In units of the radius, a steering axis is ``1 -+ kingpin`` to the side and ``tangent``
        ahead of the centre of rotation.
        """
        fastest, lock, limit = self.max_speed_mps, self.steering_limit, self.steering_limit_rad
        speed = min(max(speed, -fastest), fastest)
        steered, fixed = speed / self.steered_radius_m, speed / self.fixed_radius_m
        tangent = elementary.tan(min(max(steering, -lock), lock))
        curvature = tangent / self.wheelbase_m
        kingpin = 0.5 * self.kingpin_track_m * curvature
        stub = 0.5 * (self.steered_track_m - self.kingpin_track_m) * curvature
        half = 0.5 * self.fixed_track_m * curvature
        left, right = 1.0 - kingpin, 1.0 + kingpin
        hand = -1.0 if self.steers_rear else 1.0
        angles = [hand * elementary.atan(tangent / side) for side in (left, right)]
        return (
            # rounding may exceed the limit in the last bit
            (min(max(angles[0], -limit), limit), min(max(angles[1], -limit), limit)),
            (
                steered * (math.sqrt(left * left + tangent * tangent) - stub),
                steered * (math.sqrt(right * right + tangent * tangent) + stub),
                fixed * (1.0 - half),
                fixed * (1.0 + half),
            ),
        )


@dataclass(frozen=True)
@checked
class AckermannDescription(DriveDescription):
    """The joints of an Ackermann drive on a robot, and the limits of the drive."""

    steers = True
    steering_joints: Annotated[Sequence[str], PAIR]  # left, right: revolute, axis up
    front_wheel_joints: Annotated[Sequence[str], PAIR]  # left, right: continuous, axis points left
    rear_wheel_joints: Annotated[Sequence[str], PAIR]  # left, right: continuous, axis points left
    steering_limit_rad: Annotated[float, ANGLE]  # limit of each steered wheel
    max_speed_mps: Annotated[float, POSITIVE]  # speed limit at the middle of the fixed axle
    caster_links: Annotated[Sequence[str], LINKS] = ()  # sliding links without friction
    turning_x_m: Annotated[float | None, NUMBER] = None  # x of the turning point; None: on the axle

    @property
    def wheel_joints(self) -> tuple[str, ...]:  # type: ignore[override]
        """The joints of all four wheels, which are all driven."""
        return (*self.front_wheel_joints, *self.rear_wheel_joints)

    @classmethod
    def recognise(
        cls, steered: Sequence[Pair], others: Sequence[Pair], given: Mapping[str, Any]
    ) -> Self | None:
        """Return the drive formed by one steered and one fixed axle; None if there are others."""
        if not len(steered) == len(others) == 1:
            return None
        steering = [wheel.steering for wheel in steered[0] if wheel.steering is not None]
        rear, front = sorted((steered[0], others[0]), key=lambda pair: pair[0].x)
        stops = [min(j.upper, -j.lower) for j in steering if j.type == "revolute"]
        limits = [stop for stop in stops if 0.0 < stop < math.inf]
        found = {
            "steering_joints": tuple(joint.name for joint in steering),
            "front_wheel_joints": tuple(wheel.joint.name for wheel in front),
            "rear_wheel_joints": tuple(wheel.joint.name for wheel in rear),
            "steering_limit_rad": min([*limits, MAX_DEFAULT_STEERING_RAD])
            if limits
            else DEFAULT_STEERING_RAD,
            "max_speed_mps": default_speed([*front, *rear]),
        }
        return cls.build(found, given)

    def fit(self, urdf: Urdf) -> Ackermann:
        """Return the drive with wheelbase, tracks, radii and stops measured on a robot."""
        pairs = (self.front_wheel_joints, self.rear_wheel_joints)
        front, rear = axles = [(measure_axle(urdf, names), names) for names in pairs]
        if front[0].x <= rear[0].x:
            places = f"at x = {front[0].x:g} m, with the rear wheels at {rear[0].x:g} m"
            rule = f"front wheels must be ahead of the rear wheels, but are {places}"
            raise urdf.error(rule, "swap robot.drive.front_wheel_joints and rear_wheel_joints")
        above = urdf.joints_above(urdf.joints[self.rear_wheel_joints[0]].child)
        steers_rear = any(joint.name in self.steering_joints for joint in above)
        (steered, names), (fixed, others) = axles[::-1] if steers_rear else axles
        kingpin_track, stop = self._steering(urdf, names, steered)
        for link in self.caster_links:
            check_caster(urdf, link, self.wheel_joints)
        turning_x = fixed.x if self.turning_x_m is None else self.turning_x_m
        return Ackermann(
            steering_joints=tuple(self.steering_joints),
            wheel_joints=(*names, *others),
            wheelbase_m=front[0].x - rear[0].x,
            kingpin_track_m=kingpin_track,
            steered_track_m=steered.track,
            fixed_track_m=fixed.track,
            steered_radius_m=steered.radius,
            fixed_radius_m=fixed.radius,
            rear_axle_x_m=turning_x,
            steering_stop_rad=stop,
            steering_limit_rad=self.steering_limit_rad,
            max_speed_mps=self.max_speed_mps,
            caster_links=tuple(self.caster_links),
            slide_m=turning_x - fixed.x,
            steers_rear=steers_rear,
        )

    def _steering(self, urdf: Urdf, wheels: Sequence[str], axle: Axle) -> tuple[float, float]:
        """Return the track [m] of the joints that steer an axle's wheels, and their stop [rad]."""
        joints = [driven_joint(urdf, name, "revolute", UP) for name in self.steering_joints]
        for joint, name in zip(joints, wheels, strict=True):
            if joint not in urdf.joints_above(urdf.joints[name].child):
                rule = f"wheel joint {name!r} must be below the steering joint {joint.name!r}"
                raise urdf.error(rule, "swap the steering joints or correct the wheel's <parent>")
        places = [np.array(urdf.poses[joint.child].position) for joint in joints]
        stop, name, joint = min((min(j.upper, -j.lower), j.name, j) for j in joints)
        if stop <= 0:
            bounds = f"{name!r} turns from {joint.lower:g} to {joint.upper:g} rad"
            rule = f"steering joints must be able to turn both left and right, but {bounds}"
            raise urdf.error(rule, "widen the <limit> of both joints")
        x, track = place_axle(urdf, self.steering_joints, places, axle.radius)
        if abs(x - axle.x) > tolerated(axle.radius):
            axes = f"the wheels are at x = {axle.x:g} m, the axes at {x:g} m"
            rule = f"steered wheels must be on their steering axes, but {axes}"
            raise urdf.error(rule, "correct the joints' <origin>")
        return track, stop
