"""The interface of drives."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, Protocol, Self

from evoros.drive.rolling import Pair
from evoros.formats.urdf.tree import Urdf


class Drive(Protocol):
    """A drive bound to its robot, as simulators and controllers need it."""

    @property
    def max_speed_mps(self) -> float:
        """Maximum speed [m/s], straight ahead, of the turning point at ``rear_axle_x_m``."""

    @property
    def speed_limit_offset_m(self) -> float:
        """Lateral distance [m] from the turning point to the point that the speed limit applies to.

        In a turn the speed of the turning point is at most
        ``max_speed_mps / (1 + |curvature| * speed_limit_offset_m)``. The offset is 0 if the turning
        point has the limit, and half the track if each of two wheels has one.
        """

    @property
    def steering_limit(self) -> float:
        """Full lock: the maximum steering angle [rad] of the bicycle model."""

    @property
    def wheelbase_m(self) -> float:
        """Wheelbase [m] of the bicycle model: curvature = tan(steering) / wheelbase."""

    @property
    def turn_ratio(self) -> float:
        """Actual curvature on level ground divided by the commanded one.

        It is 1 unless the wheels slip in turns.
        """

    @property
    def rear_axle_x_m(self) -> float:
        """x [m] of the turning point, which moves along the robot's heading.

        It is on the axle that is not steered, the rear one of most robots, unless that axle slides.
        """

    @property
    def steering_joints(self) -> tuple[str, ...]:
        """Joints controlled by position."""

    @property
    def wheel_joints(self) -> tuple[str, ...]:
        """Joints controlled by velocity; their links touch the ground and nothing else.

        If ``speed_limit_offset_m`` is above 0, each side has a motor, and the first half of the
        joints is on the left.
        """

    @property
    def caster_links(self) -> tuple[str, ...]:
        """Links that slide on the ground without friction and touch nothing else."""

    def targets(self, speed: float, steering: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return angles [rad] of the steering joints and rates [rad/s] of the wheel joints."""


class DriveDescription(ABC):
    """Names the joints of a drive and sets its limits."""

    steering_joints: Sequence[str]
    """Steering joints; empty if nothing steers."""
    wheel_joints: Sequence[str]
    """Joints of all driven wheels."""
    caster_links: Sequence[str]
    """Links that slide on the ground."""

    @classmethod
    def recognise(
        cls, steered: Sequence[Pair], others: Sequence[Pair], given: Mapping[str, Any]
    ) -> Self | None:
        """Return the drive that pairs of wheels form; None if they form another, or by default.

        Both lists of pairs are ordered from front to rear. ``given`` has the fields that the user
        sets.
        """
        return None

    @classmethod
    def build(cls, found: Mapping[str, Any], given: Mapping[str, Any]) -> Self:
        """Return a drive with the fields found on a robot, overridden by the given ones."""
        names = {field.name for field in fields(cls)}  # type: ignore[arg-type]
        return cls(**{**found, **{name: given[name] for name in names & given.keys()}})

    @abstractmethod
    def fit(self, urdf: Urdf) -> Drive:
        """Return the drive bound to this robot.

        Raises:
            InputError: a joint is missing or does not fit this drive.
        """
