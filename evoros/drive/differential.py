"""Differential drive: two wheels on one axle, which turns by the difference of their speeds."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

from evoros.base import elementary
from evoros.base.checks import NUMBER, POSITIVE, checked
from evoros.drive.wheels import ANGLE, LINKS, PAIR, axle, check_caster, same_radius, wheel
from evoros.formats.urdf.tree import Urdf


@dataclass(frozen=True)
@checked
class Differential:
    """The robot turns about a point on the axle's line; casters carry the rest of it.

    The bicycle model gives the commands, as for every drive: a speed of the axle's middle and a
    steering angle, curvature = tan(steering) / wheelbase. This robot has no wheelbase: the model's
    only states which angle stands for which curvature. At speed 0 it does not turn.
    """

    steering_joints: ClassVar[tuple[str, ...]] = ()  # nothing is steered
    turn_ratio: ClassVar[float] = 1.0  # the wheels roll without slipping
    wheel_joints: tuple[str, ...]  # left, right
    caster_links: tuple[str, ...]
    wheelbase_m: Annotated[float, POSITIVE]  # of the bicycle model
    track_m: Annotated[float, POSITIVE]  # between the centres of the wheels
    wheel_radius_m: Annotated[float, POSITIVE]
    rear_axle_x_m: Annotated[float, NUMBER]  # of the axle, in the robot's frame
    steering_limit_rad: Annotated[float, ANGLE]  # of the bicycle model
    max_speed_mps: Annotated[float, POSITIVE]  # of each wheel

    @property
    def steering_limit(self) -> float:
        """Full lock: the bicycle model's angle [rad] of the maximum curvature."""
        return self.steering_limit_rad

    @property
    def speed_limit_offset_m(self) -> float:
        """Half the track: there is the outer wheel, which is the faster one."""
        return 0.5 * self.track_m

    def targets(self, speed: float, steering: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """No angles, and the rates [rad/s] of (left, right).

        ``steering`` [rad] is clipped to full lock, then ``speed`` [m/s] to the limit of the outer
        wheel: a robot that is asked for too much keeps to its curve.
        """
        lock = self.steering_limit_rad
        curvature = elementary.tan(min(max(steering, -lock), lock)) / self.wheelbase_m
        side = self.speed_limit_offset_m * curvature
        fastest = self.max_speed_mps / (1.0 + abs(side))
        rate = min(max(speed, -fastest), fastest) / self.wheel_radius_m
        return (), (rate * (1.0 - side), rate * (1.0 + side))


@dataclass(frozen=True)
@checked
class DifferentialDescription:
    """Which joints and links of a robot form a differential drive, and its limits."""

    steering_joints: ClassVar[tuple[str, ...]] = ()  # nothing is steered
    wheel_joints: Annotated[Sequence[str], PAIR]  # left, right: continuous, axis to the left
    caster_links: Annotated[Sequence[str], LINKS]  # slide on the ground without friction
    wheelbase_m: Annotated[float, POSITIVE]  # bicycle model: curvature = tan(steering) / wheelbase
    steering_limit_rad: Annotated[float, ANGLE]  # of the bicycle model
    max_speed_mps: Annotated[float, POSITIVE]  # of each wheel, along the ground

    def fit(self, urdf: Urdf) -> Differential:
        """The drive with the track and radius of this robot."""
        centers, radii = zip(*(wheel(urdf, name) for name in self.wheel_joints), strict=True)
        radius = same_radius(urdf, radii)
        x, track = axle(urdf, self.wheel_joints, centers, radius)
        for link in self.caster_links:
            check_caster(urdf, link, self.wheel_joints)
        return Differential(
            wheel_joints=tuple(self.wheel_joints),
            caster_links=tuple(self.caster_links),
            wheelbase_m=self.wheelbase_m,
            track_m=track,
            wheel_radius_m=radius,
            rear_axle_x_m=x,
            steering_limit_rad=self.steering_limit_rad,
            max_speed_mps=self.max_speed_mps,
        )
