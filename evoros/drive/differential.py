"""Differential drive: two wheels on one axle, which turns by the difference of their speeds."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import NUMBER, POSITIVE, Rule, checked
from evoros.drive.wheels import ANGLE, PAIR, TOLERANCE_M, axle, same_radius, wheel
from evoros.formats.urdf.tree import Urdf
from evoros.geometry.footprint import bottom_height

LINKS = Rule(
    "a list of the names of one or more links",
    lambda v: (
        isinstance(v, list | tuple)
        and len(v) > 0
        and all(isinstance(name, str) and name for name in v)
        and len(set(v)) == len(v)
    ),
)


@dataclass(frozen=True)
@checked
class Differential:
    """The robot turns about a point on the axle's line; casters carry the rest of it.

    Commands are those of the bicycle model, as for every drive: a speed of the axle's middle and
    a steering angle, curvature = tan(steering) / wheelbase. This robot has no wheelbase: that
    of the model only says which angle stands for which curvature. Where the speed is 0 it does
    not turn.
    """

    wheel_joints: tuple[str, ...]  # left, right
    caster_links: tuple[str, ...]
    wheelbase_m: Annotated[float, POSITIVE]  # of the bicycle model
    track_m: Annotated[float, POSITIVE]  # between the centres of the wheels
    wheel_radius_m: Annotated[float, POSITIVE]
    rear_axle_x_m: Annotated[float, NUMBER]  # of the axle, in the robot's frame
    steering_limit_rad: Annotated[float, ANGLE]  # of the bicycle model
    max_speed_mps: Annotated[float, POSITIVE]  # of each wheel

    @property
    def steering_joints(self) -> tuple[str, ...]:
        """Nothing is steered."""
        return ()

    @property
    def steering_limit(self) -> float:
        """Full lock: the bicycle model's angle [rad] of the greatest curvature."""
        return self.steering_limit_rad

    @property
    def speed_limit_offset_m(self) -> float:
        """Half the track: there is the outer wheel, which is the faster one."""
        return 0.5 * self.track_m

    def targets(self, speed: float, steering: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """No angles, and the rates [rad/s] of (left, right).

        ``steering`` [rad] is clipped to full lock, then ``speed`` [m/s] so that the outer wheel
        is at most at its limit: a robot that is asked for too much keeps to its curve.
        """
        lock = self.steering_limit_rad
        curvature = math.tan(min(max(steering, -lock), lock)) / self.wheelbase_m
        side = self.speed_limit_offset_m * curvature
        fastest = self.max_speed_mps / (1.0 + abs(side))
        rate = min(max(speed, -fastest), fastest) / self.wheel_radius_m
        return (), (rate * (1.0 - side), rate * (1.0 + side))


@dataclass(frozen=True)
@checked
class DifferentialDescription:
    """Which joints and links of a robot form a differential drive, and its limits."""

    wheel_joints: Annotated[Sequence[str], PAIR]  # left, right: continuous, axis to the left
    caster_links: Annotated[Sequence[str], LINKS]  # slide on the ground without friction
    wheelbase_m: Annotated[float, POSITIVE]  # bicycle model: curvature = tan(steering) / wheelbase
    steering_limit_rad: Annotated[float, ANGLE]  # of the bicycle model
    max_speed_mps: Annotated[float, POSITIVE]  # of each wheel, along the ground

    def fit(self, urdf: Urdf) -> Differential:
        """The drive with the track and radius of this robot.

        Raises:
            InputError: a joint or link is missing, or does not fit such a drive.
        """
        centers, radii = zip(*(wheel(urdf, name) for name in self.wheel_joints), strict=True)
        radius = same_radius(urdf, radii)
        x, track = axle(urdf, self.wheel_joints, centers)
        wheels = {urdf.joints[name].child for name in self.wheel_joints}
        for link in self.caster_links:
            if link in wheels:
                raise urdf.error(f"caster {link!r} must not be a driven wheel", "name another link")
            _check_caster(urdf, link)
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


def _check_caster(urdf: Urdf, link: str) -> None:
    """A caster has a shape, and its lowest point is on the ground."""
    if link not in urdf.poses:
        known = ", ".join(sorted(urdf.poses))
        raise urdf.error(f"caster link {link!r} must exist", f"name one of: {known}")
    shapes, pose = urdf.shapes[link], urdf.poses[link]
    if not shapes or link == urdf.root:
        rule = f"caster {link!r} must be a link of its own with a collision shape"
        raise urdf.error(rule, "give it a <link> with a sphere for <collision>")
    height = min(bottom_height(shape, pose @ shape.pose) for shape in shapes)
    if abs(height) > TOLERANCE_M:
        rule = f"caster {link!r} must touch the ground, which is at the height 0 of {urdf.root!r}"
        cure = "correct the <origin> of its joint"
        raise urdf.error(f"{rule}, but its lowest point is at {height:g} m", cure)
