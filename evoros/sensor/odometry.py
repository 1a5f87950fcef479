"""Wheel odometry: speed and yaw rate from the turning of the wheels."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from numpy.random import Generator

from evoros.base.arrays import NO_PARAMETERS, Array
from evoros.base.checks import NOT_NEGATIVE, POSITIVE, checked
from evoros.filter.protocol import FILTERS, Filter
from evoros.sensor.protocol import BOX, SIGNAL_SIZES, WHEELS, Channel
from evoros.sensor.signals import DISTANCE, TURN

# What the rule remembers of the last reading, after the signal.
_TIME = SIGNAL_SIZES[WHEELS]  # [s]
_GONE, _TURNED = _TIME + 1, _TIME + 2  # [m], [rad]


@dataclass(frozen=True)
@checked
class Odometry:
    """Mean speed and yaw rate since the last reading, as the encoders of the wheels tell them.

    The speed is that of the middle of the wheels that are not steered. They tell what they rolled:
    if they slip, the robot has moved otherwise. The first reading is 0. Errors of the wheels' size
    and of the track are filters (``Scale``).
    """

    measures: ClassVar[str] = WHEELS
    memory_size: ClassVar[int] = 3
    period_s: Annotated[float, POSITIVE] = 0.1  # time between two readings
    size_m: Annotated[Sequence[float], BOX] = (0.01, 0.01, 0.01)
    mass_kg: Annotated[float, POSITIVE] = 0.01
    price: Annotated[float, NOT_NEGATIVE] = 15.0
    filters: Annotated[Mapping[str, Filter], FILTERS] = field(default_factory=dict)  # in order

    @property
    def channels(self) -> tuple[Channel, Channel]:
        """The speed and the yaw rate, left positive."""
        return (
            Channel("speed", "mps", -math.inf, math.inf),
            Channel("yaw_rate", "radps", -math.inf, math.inf),
        )

    def parameters(self) -> Array:
        """Return none."""
        return NO_PARAMETERS

    @staticmethod
    def rule(parameters: Array, memory: Array, rng: Generator, values: Array, time: float) -> None:
        """Divide what the wheels have rolled since the last reading by the time since then."""
        elapsed = time - memory[_TIME]
        values[0] = (memory[DISTANCE] - memory[_GONE]) / elapsed if elapsed > 0.0 else 0.0
        values[1] = (memory[TURN] - memory[_TURNED]) / elapsed if elapsed > 0.0 else 0.0
        memory[_TIME] = time
        memory[_GONE] = memory[DISTANCE]
        memory[_TURNED] = memory[TURN]

    def gazebo(self, name: str) -> str:
        """Return nothing: in Gazebo, the plugin of the drive tells the odometry."""
        return ""
