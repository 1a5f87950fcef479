"""Wheel odometry: speed and yaw rate from the rotation of the wheels."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

import numpy as np

from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, POSITIVE, checked
from evoros.filter.protocol import FILTERS, Filter
from evoros.sensor.protocol import BOX, WHEELS, Channel, SignalSensor
from evoros.sensor.signals import DISTANCE, TURN


@dataclass(frozen=True)
@checked
class Odometry(SignalSensor):
    """The mean speed and yaw rate since the last reading, from wheel encoders.

    The speed is that at the midpoint of the unsteered wheels. Wheel slip causes errors. The first
    reading is 0. The filter ``Scale`` models errors of wheel size or track.
    """

    measures = WHEELS
    period_s: Annotated[float, POSITIVE] = 0.1  # time between readings
    size_m: Annotated[Sequence[float], BOX] = (0.01, 0.01, 0.01)
    mass_kg: Annotated[float, POSITIVE] = 0.01
    price: Annotated[float, NOT_NEGATIVE] = 15.0
    filters: Annotated[Mapping[str, Filter], FILTERS] = field(default_factory=dict)  # order matters

    @property
    def channels(self) -> tuple[Channel, Channel]:
        return (
            Channel("speed", "mps", -math.inf, math.inf),
            Channel("yaw_rate", "radps", -math.inf, math.inf),
        )

    class Memory(NamedTuple):
        time: Array  # (1,) [s], time of the last reading
        signal: Array  # (2,) signal at the last reading

    def start(self) -> tuple[None, Memory]:
        return None, self.Memory(np.zeros(1), np.zeros(2))

    @staticmethod
    def rule(memory: Memory, signal: Array, values: Array, time: float) -> None:
        """Divide the distance and rotation since the last reading by the elapsed time."""
        elapsed = time - memory.time[0]
        for i in (DISTANCE, TURN):
            values[i] = (signal[i] - memory.signal[i]) / elapsed if elapsed > 0.0 else 0.0
            memory.signal[i] = signal[i]
        memory.time[0] = time
