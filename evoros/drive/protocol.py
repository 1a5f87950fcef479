"""The interface of drives."""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from evoros.formats.urdf.tree import Urdf


class Drive(Protocol):
    """A drive on its robot, as simulators and controllers need it."""

    @property
    def max_speed_mps(self) -> float:
        """Maximum speed, straight ahead, of the point at ``rear_axle_x_m``."""

    @property
    def speed_limit_offset_m(self) -> float:
        """How far to the side of that point the limit of the speed applies.

        In a turn the speed of the point is at most
        ``max_speed_mps / (1 + |curvature| * speed_limit_offset_m)``. The offset is 0 if the point
        itself has the limit, and half the track if each of two wheels has one.
        """

    @property
    def steering_limit(self) -> float:
        """Full lock: the maximum steering angle [rad] of the bicycle model."""

    @property
    def wheelbase_m(self) -> float:
        """Wheelbase of the bicycle model: curvature = tan(steering) / wheelbase."""

    @property
    def turn_ratio(self) -> float:
        """The curvature that the robot drives on level ground, divided by the commanded one.

        It is 1 but for a drive whose wheels slip when it turns.
        """

    @property
    def rear_axle_x_m(self) -> float:
        """Where on the robot's x axis the point lies that moves as the robot heads.

        The rear axle, unless the rear of the robot slides.
        """

    @property
    def steering_joints(self) -> tuple[str, ...]:
        """Controlled by position."""

    @property
    def wheel_joints(self) -> tuple[str, ...]:
        """Controlled by velocity. Their links touch the ground and nothing else.

        If ``speed_limit_offset_m`` is above 0, each side has a motor, and its wheels are one half:
        first those on the left, then those on the right.
        """

    @property
    def caster_links(self) -> tuple[str, ...]:
        """Links that slide on the ground without friction and touch nothing else."""

    def targets(self, speed: float, steering: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Angles [rad] of the steering joints and rates [rad/s] of the wheel joints."""


@runtime_checkable
class DriveDescription(Protocol):
    """Names the joints of a drive and sets its limits."""

    @property
    def steering_joints(self) -> Sequence[str]:
        """The joints that steer; empty if nothing is steered."""

    @property
    def wheel_joints(self) -> Sequence[str]:
        """The joints of all driven wheels."""

    @property
    def caster_links(self) -> Sequence[str]:
        """Links that slide on the ground."""

    def fit(self, urdf: Urdf) -> Drive:
        """The drive on this robot.

        Raises:
            InputError: a joint is missing, or does not fit such a drive.
        """
