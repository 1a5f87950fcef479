"""Ackermann steering: four wheels, the front ones steered so that none of them slips."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, ClassVar

import numpy as np

from evoros.base import elementary
from evoros.base.checks import NUMBER, POSITIVE, checked, invalid
from evoros.drive.wheels import (
    ANGLE,
    LINKS,
    PAIR,
    UP,
    axle,
    check_caster,
    driven_joint,
    same_radius,
    tolerated,
    wheel,
)
from evoros.formats.urdf.tree import Urdf


@dataclass(frozen=True)
@checked
class Ackermann:
    """All axles meet in the instant centre of rotation, about which every wheel rolls.

    It lies on the rear axle's line, ``wheelbase / tan(steering)`` to the left of its middle,
    where ``steering`` is the bicycle model's angle. Each wheel stands across its line to the
    centre and is as fast as it is far from it.
    """

    speed_limit_offset_m: ClassVar[float] = 0.0  # the rear axle's middle has the limit
    turn_ratio: ClassVar[float] = 1.0  # the wheels roll without slipping
    steering_joints: tuple[str, ...]  # front left, front right
    wheel_joints: tuple[str, ...]  # front left, front right, rear left, rear right
    wheelbase_m: Annotated[float, POSITIVE]
    kingpin_track_m: Annotated[float, POSITIVE]  # between the axes of the steering joints
    front_track_m: Annotated[float, POSITIVE]  # between the front wheels' centres, straight ahead
    rear_track_m: Annotated[float, POSITIVE]
    wheel_radius_m: Annotated[float, POSITIVE]
    rear_axle_x_m: Annotated[float, NUMBER]  # of the rear axle, plus the slide
    steering_stop_rad: Annotated[float, POSITIVE]  # how far the steering joints can turn
    steering_limit_rad: Annotated[float, ANGLE]  # how far each of them may turn
    max_speed_mps: Annotated[float, POSITIVE]  # of the rear axle's middle
    caster_links: tuple[str, ...] = ()
    slide_m: Annotated[float, NUMBER] = 0.0
    """How far ahead of the rear axle the point lies that moves as the robot heads. The geometry
    gives the circle. Wheels that roll do not slide, so only the planar simulator follows."""

    def __post_init__(self) -> None:
        if self.steering_limit_rad > self.steering_stop_rad:
            rule = f"must be at most {self.steering_stop_rad:g}, where the steering joints stop"
            raise invalid(self, "steering_limit_rad", self.steering_limit_rad, rule)

    @cached_property
    def steering_limit(self) -> float:
        """Full lock: the bicycle model's angle [rad] at which the inner wheel is at its limit."""
        tangent = elementary.tan(self.steering_limit_rad)
        length = self.wheelbase_m
        return elementary.atan(length * tangent / (length + 0.5 * self.kingpin_track_m * tangent))

    def targets(self, speed: float, steering: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Angles [rad] of (left, right), rates [rad/s] of (front left, front right, rear ...).

        ``speed`` [m/s] of the rear axle's middle and ``steering`` [rad] of the bicycle model are
        clipped to what the robot can do. The curvature is the variable, not the radius: it is 0
        straight ahead. In units of the radius, a front wheel's steering axis is ``1 -+ kingpin``
        to the side of the centre of rotation and ``tangent`` ahead of it.
        """
        fastest, lock, limit = self.max_speed_mps, self.steering_limit, self.steering_limit_rad
        rate = min(max(speed, -fastest), fastest) / self.wheel_radius_m
        tangent = elementary.tan(min(max(steering, -lock), lock))
        curvature = tangent / self.wheelbase_m
        kingpin = 0.5 * self.kingpin_track_m * curvature
        stub = 0.5 * (self.front_track_m - self.kingpin_track_m) * curvature
        rear = 0.5 * self.rear_track_m * curvature
        left, right = 1.0 - kingpin, 1.0 + kingpin
        angles = (elementary.atan(tangent / left), elementary.atan(tangent / right))
        return (
            # Rounding may pass the limit by a bit.
            (min(max(angles[0], -limit), limit), min(max(angles[1], -limit), limit)),
            (
                rate * (math.sqrt(left * left + tangent * tangent) - stub),
                rate * (math.sqrt(right * right + tangent * tangent) + stub),
                rate * (1.0 - rear),
                rate * (1.0 + rear),
            ),
        )


@dataclass(frozen=True)
@checked
class AckermannDescription:
    """Which joints of a robot form an Ackermann drive, and its limits."""

    steering_joints: Annotated[Sequence[str], PAIR]  # left, right: revolute, axis up
    front_wheel_joints: Annotated[Sequence[str], PAIR]  # left, right: continuous, axis to the left
    rear_wheel_joints: Annotated[Sequence[str], PAIR]  # left, right: continuous, axis to the left
    steering_limit_rad: Annotated[float, ANGLE]  # of each front wheel
    max_speed_mps: Annotated[float, POSITIVE]  # of the rear axle's middle
    caster_links: Annotated[Sequence[str], LINKS] = ()  # slide on the ground without friction
    turning_x_m: Annotated[float | None, NUMBER] = None
    """Where on the robot's x axis the point lies that moves as the robot heads; None: on the rear
    axle. A robot whose rear slides outwards turns about a point ahead of it."""

    @property
    def wheel_joints(self) -> tuple[str, ...]:
        """All four wheels are driven."""
        return (*self.front_wheel_joints, *self.rear_wheel_joints)

    def fit(self, urdf: Urdf) -> Ackermann:
        """The drive with the wheelbase, tracks, radius and stops of this robot."""
        names = self.wheel_joints
        centers, radii = zip(*(wheel(urdf, name) for name in names), strict=True)
        radius = same_radius(urdf, radii)
        front_x, front_track = axle(urdf, self.front_wheel_joints, centers[:2], radius)
        rear_x, rear_track = axle(urdf, self.rear_wheel_joints, centers[2:], radius)
        kingpin_x, kingpin_track, stop = self._steering(urdf, radius)
        for link in self.caster_links:
            check_caster(urdf, link, names)
        if abs(kingpin_x - front_x) > tolerated(radius) or front_x <= rear_x:
            rule = "front wheels must be on their steering axes, ahead of the rear wheels"
            axes = f"{front_x:g} m with the axes at {kingpin_x:g} and the rear wheels at {rear_x:g}"
            raise urdf.error(f"{rule}, not at x = {axes} m", "correct the joints' <origin>")
        turning_x = rear_x if self.turning_x_m is None else self.turning_x_m
        return Ackermann(
            steering_joints=tuple(self.steering_joints),
            wheel_joints=names,
            wheelbase_m=front_x - rear_x,
            kingpin_track_m=kingpin_track,
            front_track_m=front_track,
            rear_track_m=rear_track,
            wheel_radius_m=radius,
            rear_axle_x_m=turning_x,
            steering_stop_rad=stop,
            steering_limit_rad=self.steering_limit_rad,
            max_speed_mps=self.max_speed_mps,
            caster_links=tuple(self.caster_links),
            slide_m=turning_x - rear_x,
        )

    def _steering(self, urdf: Urdf, radius: float) -> tuple[float, float, float]:
        """x [m], track [m] and stop [rad] of the steering joints."""
        joints = [driven_joint(urdf, name, "revolute", UP) for name in self.steering_joints]
        for joint, name in zip(joints, self.front_wheel_joints, strict=True):
            link = urdf.joints[name].child
            if joint not in urdf.joints_above(link):
                rule = f"joint {name!r} must be steered by {joint.name!r}"
                raise urdf.error(rule, "swap the names or correct its <parent>")
        places = [np.array(urdf.poses[joint.child].position) for joint in joints]
        stop = min(min(joint.upper, -joint.lower) for joint in joints)
        if stop <= 0:
            raise urdf.error("steering joints must turn to both sides", "widen their <limit>")
        return (*axle(urdf, self.steering_joints, places, radius), stop)
