"""Differential drive: two wheels on one axle, which steer by their speed difference."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Self

from evoros.base.checks import POSITIVE, checked
from evoros.drive.candidates import default_bicycle
from evoros.drive.protocol import ANGLE, LINKS, PAIR, DriveDescription, check_caster, measure_axle
from evoros.drive.rolling import Pair
from evoros.drive.skid_steer import AT_LEAST_ONE, SkidSteer
from evoros.formats.urdf.tree import Urdf


@dataclass(frozen=True)
@checked
class Differential(SkidSteer):
    """A drive with two wheels on one axle; the robot turns about a point on the axle line.

    Casters carry the rest of the weight. The wheelbase serves only to map steering angles to
    curvatures.
    """

    wheel_separation_multiplier: Annotated[float, POSITIVE] = 1.0
    turning_resistance: Annotated[float, AT_LEAST_ONE] = 1.0


@dataclass(frozen=True)
@checked
class DifferentialDescription(DriveDescription):
    """The joints and links of a differential drive on a robot, and the limits of the drive."""

    on_one_axle = True
    steering_joints = ()  # nothing is steered
    wheel_joints: Annotated[Sequence[str], PAIR]  # left, right: continuous, axis points left
    caster_links: Annotated[Sequence[str], LINKS]  # links that slide on the ground without friction
    wheelbase_m: Annotated[float, POSITIVE]  # bicycle model: curvature = tan(steering) / wheelbase
    steering_limit_rad: Annotated[float, ANGLE]  # bicycle model
    max_speed_mps: Annotated[float, POSITIVE]  # rim speed of each wheel

    @classmethod
    def recognise(
        cls, steered: Sequence[Pair], others: Sequence[Pair], given: Mapping[str, Any]
    ) -> Self | None:
        """Return the drive formed by a single unsteered axle; None if there are other axles."""
        if steered or len(others) != 1:
            return None
        joints = tuple(wheel.joint.name for wheel in others[0])
        return cls.build({"wheel_joints": joints, **default_bicycle(others)}, given)

    def fit(self, urdf: Urdf) -> Differential:
        """Return the drive with track and wheel radius measured on a robot."""
        axle = measure_axle(urdf, self.wheel_joints)
        for link in self.caster_links:
            check_caster(urdf, link, self.wheel_joints)
        return Differential(
            wheel_joints=tuple(self.wheel_joints),
            caster_links=tuple(self.caster_links),
            wheelbase_m=self.wheelbase_m,
            track_m=axle.track,
            wheel_radii_m=(axle.radius,),
            rear_axle_x_m=axle.x,
            steering_limit_rad=self.steering_limit_rad,
            max_speed_mps=self.max_speed_mps,
        )
