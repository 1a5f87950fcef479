"""Skid-steer: two or more driven wheels on each side, which slip sideways when the robot turns."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.checks import NUMBER, POSITIVE, Rule, checked, is_number
from evoros.drive.wheels import (
    ANGLE,
    LINKS,
    SIDE,
    axle,
    check_caster,
    same_radius,
    tolerated,
    wheel,
)
from evoros.formats.urdf.tree import Urdf

AT_LEAST_ONE = Rule("a number of at least 1", lambda v: is_number(v) and v >= 1)


def compute_turning_resistance(wheel_x_m: Sequence[float], track_m: float) -> float:
    """Return how much farther apart the wheels seem to be than they are, in a steady turn.

    ``wheel_x_m`` are the places along the robot of the wheels of one side.

    All wheels carry the same load, with Coulomb friction, equal in all directions. In a turn at the
    rate w about the middle of the wheels, the wheel at x slides sideways at ``x w`` and, because
    its rim is faster than the ground passes, lengthwise at ``s``. Each force is against its slip,
    so that the turning moment of the wheels vanishes if

        sum_i [(track / 2) s - x_i^2 w] / sqrt(s^2 + x_i^2 w^2) = 0.

    The sum grows with ``q = s / w`` from below 0, so it has one root. The wheels then run as those
    of a robot with the track ``track + 2 q`` that does not slip. For two wheels a side at the
    distance L, every root is equal and ``q = L^2 / (2 track)``, so the result is
    ``1 + (L / track)^2``, whatever the coefficient of friction and the speed.
    """
    places = np.array(wheel_x_m, dtype=np.float64)
    squares: Array = (places - places.mean()) ** 2
    if float(squares.max()) < 1e-18:
        return 1.0
    low, high = 0.0, 2.0 * float(squares.max()) / track_m  # no term is negative at the upper end
    for _ in range(200):
        middle = 0.5 * (low + high)
        moment = (0.5 * track_m * middle - squares) / np.sqrt(middle * middle + squares + 1e-300)
        low, high = (middle, high) if float(moment.sum()) < 0.0 else (low, middle)
    return 1.0 + (low + high) / track_m


@dataclass(frozen=True)
@checked
class SkidSteer:
    """The wheels of each side turn at one rate; the robot turns as if its track were wider.

    The bicycle model gives the commands: a speed of the wheels' middle and a steering angle,
    curvature = tan(steering) / wheelbase. At speed 0 the robot does not turn.
    """

    steering_joints: ClassVar[tuple[str, ...]] = ()  # nothing is steered
    wheel_joints: tuple[str, ...]  # those on the left, then as many on the right
    caster_links: tuple[str, ...]
    wheelbase_m: Annotated[float, POSITIVE]  # of the bicycle model
    track_m: Annotated[float, POSITIVE]  # between the centres of the wheels
    wheel_radius_m: Annotated[float, POSITIVE]
    rear_axle_x_m: Annotated[float, NUMBER]  # of the wheels' middle, in the robot's frame
    steering_limit_rad: Annotated[float, ANGLE]  # of the bicycle model
    max_speed_mps: Annotated[float, POSITIVE]  # of each wheel
    wheel_separation_multiplier: Annotated[float, POSITIVE]  # what the commands assume
    turning_resistance: Annotated[float, AT_LEAST_ONE]  # how the robot turns: effective track

    @property
    def steering_limit(self) -> float:
        """Full lock: the bicycle model's angle [rad] of the maximum curvature."""
        return self.steering_limit_rad

    @property
    def turn_ratio(self) -> float:
        """1 if the commands allow for the whole turning resistance."""
        return self.wheel_separation_multiplier / self.turning_resistance

    @property
    def speed_limit_offset_m(self) -> float:
        """Half the track that the robot seems to have: there is the rim of the outer wheels."""
        return 0.5 * self.track_m * self.turning_resistance

    def targets(self, speed: float, steering: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """No angles, and the rates [rad/s] of the wheels.

        ``steering`` [rad] is clipped to full lock, then ``speed`` [m/s] to the limit of the outer
        wheels: a robot that is asked for too much keeps to its curve.
        """
        lock = self.steering_limit_rad
        curvature = elementary.tan(min(max(steering, -lock), lock)) / self.wheelbase_m
        side = 0.5 * self.track_m * self.wheel_separation_multiplier * curvature
        fastest = self.max_speed_mps / (1.0 + abs(side))
        rate = min(max(speed, -fastest), fastest) / self.wheel_radius_m
        count = len(self.wheel_joints) // 2
        return (), (rate * (1.0 - side),) * count + (rate * (1.0 + side),) * count


@dataclass(frozen=True)
@checked
class SkidSteerDescription:
    """Which joints of a robot form a skid-steer drive, its limits and how it turns."""

    steering_joints: ClassVar[tuple[str, ...]] = ()  # nothing is steered
    left_wheel_joints: Annotated[Sequence[str], SIDE]  # front to rear
    right_wheel_joints: Annotated[Sequence[str], SIDE]  # front to rear, each opposite a left one
    wheelbase_m: Annotated[float, POSITIVE]  # bicycle model: curvature = tan(steering) / wheelbase
    steering_limit_rad: Annotated[float, ANGLE]  # of the bicycle model
    max_speed_mps: Annotated[float, POSITIVE]  # of each wheel, along the ground
    wheel_separation_multiplier: Annotated[float | None, POSITIVE] = None
    """The track that commands assume, divided by the geometric one; None: as below."""
    turning_resistance: Annotated[float | None, AT_LEAST_ONE] = None
    """The track that the robot seems to have when it turns, divided by the geometric one; None:
    computed (``compute_turning_resistance``)."""
    caster_links: Annotated[Sequence[str], LINKS] = ()  # slide on the ground without friction

    @property
    def wheel_joints(self) -> tuple[str, ...]:
        """Those on the left, then those on the right."""
        return (*self.left_wheel_joints, *self.right_wheel_joints)

    def fit(self, urdf: Urdf) -> SkidSteer:
        """The drive with the tracks, radius and turning resistance of this robot."""
        pairs = list(zip(self.left_wheel_joints, self.right_wheel_joints, strict=False))
        if not len(pairs) == len(self.left_wheel_joints) == len(self.right_wheel_joints):
            raise urdf.error("both sides must have as many wheels", "name the joints of each pair")
        wheels = {name: wheel(urdf, name) for name in self.wheel_joints}
        radius = same_radius(urdf, [radius for _, radius in wheels.values()])
        axles = [axle(urdf, pair, [wheels[name][0] for name in pair], radius) for pair in pairs]
        tracks = [track for _, track in axles]
        if max(tracks) - min(tracks) > 2.0 * tolerated(radius):
            widths = ", ".join(f"{track:g}" for track in tracks)
            problem = f"axles must be equally wide, not {widths} m"
            raise urdf.error(problem, "correct their <origin>")
        for link in self.caster_links:
            check_caster(urdf, link, self.wheel_joints)
        places, track = [x for x, _ in axles], math.fsum(tracks) / len(tracks)
        resistance = self.turning_resistance or compute_turning_resistance(places, track)
        return SkidSteer(
            wheel_joints=self.wheel_joints,
            caster_links=tuple(self.caster_links),
            wheelbase_m=self.wheelbase_m,
            track_m=track,
            wheel_radius_m=radius,
            rear_axle_x_m=math.fsum(places) / len(places),
            steering_limit_rad=self.steering_limit_rad,
            max_speed_mps=self.max_speed_mps,
            wheel_separation_multiplier=self.wheel_separation_multiplier or resistance,
            turning_resistance=resistance,
        )
