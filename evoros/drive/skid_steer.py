"""Skid-steer: two or more driven wheels per side, which slip sideways in turns."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Self

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.checks import NUMBER, POSITIVE, Rule, checked, is_number
from evoros.drive.candidates import default_bicycle
from evoros.drive.protocol import ANGLE, LINKS, SIDE, DriveDescription, check_caster, measure_axle
from evoros.drive.rolling import Pair
from evoros.formats.urdf.tree import Urdf

AT_LEAST_ONE = Rule("a number >= 1", lambda v: is_number(v) and v >= 1)
RADII = Rule("positive numbers", lambda v: bool(v) and all(map(POSITIVE.holds, v)))


def compute_turning_resistance(wheel_x_m: Sequence[float], tracks_m: Sequence[float]) -> float:
    """Return the ratio of effective to geometric track in a steady turn.

    All wheels carry the same load and have isotropic Coulomb friction. In a turn at the rate w
    about the middle of the wheels, the wheel at x slides sideways at ``x w`` and, because its rim
    moves faster than the ground, lengthwise at ``s``. On an axle with the mean track, ``s = q w``;
    on other axles, ``s = (q + (mean - track) / 2) w``. Each force opposes its slip, so the turning
    moment of the wheels vanishes if

    sum_i [(track_i / 2) s_i - x_i^2 w] / sqrt(s_i^2 + x_i^2 w^2) = 0.

    The sum increases with q, so it has one root. The robot then turns like one with the track
    ``mean + 2 q`` whose wheels do not slip lengthwise. For two wheels per side, at the distance L
    on axles of equal track, ``q = L^2 / (2 track)``, so the result is ``1 + (L / track)^2`` for any
    coefficient of friction and any speed.
    """
    places, track = np.array(wheel_x_m, dtype=np.float64), math.fsum(tracks_m) / len(tracks_m)
    narrower = 0.5 * np.round(track - np.array(tracks_m), 9)  # exactly 0 for equal tracks
    tracks: Array = track - 2.0 * narrower
    squares: Array = (places - places.mean()) ** 2
    if float(squares.max()) < 1e-18:
        return 1.0
    # No term is positive at the lower end or negative at the upper end.
    low = -float(narrower.max())
    high = 2.0 * float((squares / tracks).max()) - float(narrower.min())
    for _ in range(200):
        middle = 0.5 * (low + high)
        slip = middle + narrower
        moment = (0.5 * tracks * slip - squares) / np.sqrt(slip * slip + squares + 1e-300)
        low, high = (middle, high) if float(moment.sum()) < 0.0 else (low, middle)
    return max(1.0, 1.0 + (low + high) / track)


@dataclass(frozen=True)
@checked
class SkidSteer:
    """A drive with one wheel speed per side; the robot turns as if its track were wider.

    Commands follow the bicycle model: a speed at the middle of the wheels and a steering angle,
    with curvature = tan(steering) / wheelbase. At speed 0, the robot does not turn.
    """

    steering_joints: ClassVar[tuple[str, ...]] = ()  # nothing is steered
    wheel_joints: tuple[str, ...]  # all left joints, then all right joints
    caster_links: tuple[str, ...]
    wheelbase_m: Annotated[float, POSITIVE]  # wheelbase of the bicycle model
    track_m: Annotated[float, POSITIVE]  # distance between wheel centres, averaged over the axles
    wheel_radii_m: Annotated[Sequence[float], RADII]  # one per axle, front to rear
    rear_axle_x_m: Annotated[float, NUMBER]  # x of the middle of the wheels in the robot's frame
    steering_limit_rad: Annotated[float, ANGLE]  # bicycle model
    max_speed_mps: Annotated[float, POSITIVE]  # rim speed of each wheel
    wheel_separation_multiplier: Annotated[float, POSITIVE]  # assumed effective / geometric track
    turning_resistance: Annotated[float, AT_LEAST_ONE]  # actual ratio of these tracks

    @property
    def steering_limit(self) -> float:
        """Full lock: the angle [rad] of the bicycle model at maximum curvature."""
        return self.steering_limit_rad

    @property
    def turn_ratio(self) -> float:
        """The ratio of actual to commanded curvature; 1 if commands compensate the slip."""
        return self.wheel_separation_multiplier / self.turning_resistance

    @property
    def speed_limit_offset_m(self) -> float:
        """Half the effective track, where the ground moves as fast as the outer rims."""
        return 0.5 * self.track_m * self.turning_resistance

    def targets(self, speed: float, steering: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return no angles, and the wheel rates [rad/s]; steering has priority over speed."""
        lock = self.steering_limit_rad
        curvature = elementary.tan(min(max(steering, -lock), lock)) / self.wheelbase_m
        side = 0.5 * self.track_m * self.wheel_separation_multiplier * curvature
        fastest = self.max_speed_mps / (1.0 + abs(side))
        speed = min(max(speed, -fastest), fastest)
        rates = [speed / radius for radius in self.wheel_radii_m]
        left, right = (tuple(rate * share for rate in rates) for share in (1.0 - side, 1.0 + side))
        return (), (*left, *right)


@dataclass(frozen=True)
@checked
class SkidSteerDescription(DriveDescription):
    """The joints of a skid-steer drive on a robot, with limits and turning resistance."""

    locks_steering = True
    steering_joints = ()  # nothing is steered
    left_wheel_joints: Annotated[Sequence[str], SIDE]  # front to rear
    right_wheel_joints: Annotated[Sequence[str], SIDE]  # front to rear, opposite the left joints
    wheelbase_m: Annotated[float, POSITIVE]  # bicycle model: curvature = tan(steering) / wheelbase
    steering_limit_rad: Annotated[float, ANGLE]  # bicycle model
    max_speed_mps: Annotated[float, POSITIVE]  # rim speed of each wheel
    wheel_separation_multiplier: Annotated[float | None, POSITIVE] = None
    """Ratio of effective to geometric track that commands assume; None: the actual ratio."""
    turning_resistance: Annotated[float | None, AT_LEAST_ONE] = None
    """Actual ratio of effective to geometric track; None: ``compute_turning_resistance``."""
    caster_links: Annotated[Sequence[str], LINKS] = ()  # slide on the ground without friction

    @property
    def wheel_joints(self) -> tuple[str, ...]:  # type: ignore[override]
        """The left joints, then the right joints."""
        return (*self.left_wheel_joints, *self.right_wheel_joints)

    @classmethod
    def recognise(
        cls, steered: Sequence[Pair], others: Sequence[Pair], given: Mapping[str, Any]
    ) -> Self | None:
        """Return the drive formed by several unsteered axles; None if there are others."""
        if steered or len(others) < 2:
            return None
        sides = zip(*others, strict=True)
        left, right = (tuple(wheel.joint.name for wheel in side) for side in sides)
        found = {"left_wheel_joints": left, "right_wheel_joints": right, **default_bicycle(others)}
        return cls.build(found, given)

    def fit(self, urdf: Urdf) -> SkidSteer:
        """Return the drive with tracks, radii and turning resistance measured on a robot."""
        pairs = list(zip(self.left_wheel_joints, self.right_wheel_joints, strict=False))
        if not len(pairs) == len(self.left_wheel_joints) == len(self.right_wheel_joints):
            rule = "both sides must have the same number of wheels"
            raise urdf.error(rule, "name the joints of each pair")
        places, tracks, radii = zip(*(measure_axle(urdf, pair) for pair in pairs), strict=True)
        for link in self.caster_links:
            check_caster(urdf, link, self.wheel_joints)
        resistance = self.turning_resistance or compute_turning_resistance(places, tracks)
        return SkidSteer(
            wheel_joints=self.wheel_joints,
            caster_links=tuple(self.caster_links),
            wheelbase_m=self.wheelbase_m,
            track_m=math.fsum(tracks) / len(tracks),
            wheel_radii_m=radii,
            rear_axle_x_m=math.fsum(places) / len(places),
            steering_limit_rad=self.steering_limit_rad,
            max_speed_mps=self.max_speed_mps,
            wheel_separation_multiplier=self.wheel_separation_multiplier or resistance,
            turning_resistance=resistance,
        )
