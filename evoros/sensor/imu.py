"""An inertial measurement unit with three gyroscopes and three accelerometers."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, NamedTuple

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.checks import NOT_NEGATIVE, POSITIVE, checked
from evoros.base.compilable import compilable
from evoros.filter.protocol import FILTERS, Filter
from evoros.sensor.gazebo_rays import gazebo_sensor
from evoros.sensor.protocol import BOX, MOTION, Channel, SignalSensor
from evoros.sensor.signals import GRAVITY, ORIENTATION, TURNING, VELOCITY

_AXES = ("x", "y", "z")
_SMALL_RAD = 1e-9  # half rotation angle below which the axis is undefined


@dataclass(frozen=True)
@checked
class Imu(SignalSensor):
    """Angular rates and accelerations along the axes of the sensor's frame, x forward, z up.

    Each reading is the mean since the previous reading; the first contains the current rates and
    only gravity. The acceleration is the specific force: at rest on level ground, it equals gravity
    and points up. The defaults are close to InvenSense's MPU-9250.
    """

    measures = MOTION
    rate_max_radps: Annotated[float, POSITIVE] = 34.9  # 2000 deg/s in both directions
    acceleration_max_mps2: Annotated[float, POSITIVE] = 157.0  # 16 g in both directions
    period_s: Annotated[float, POSITIVE] = 0.1  # time between readings
    size_m: Annotated[Sequence[float], BOX] = (0.015, 0.026, 0.003)
    mass_kg: Annotated[float, POSITIVE] = 0.003
    price: Annotated[float, NOT_NEGATIVE] = 10.0
    filters: Annotated[Mapping[str, Filter], FILTERS] = field(default_factory=dict)  # order matters

    @property
    def channels(self) -> tuple[Channel, ...]:
        fastest, strongest = self.rate_max_radps, self.acceleration_max_mps2
        return (
            *(Channel(f"rate_{axis}", "radps", -fastest, fastest) for axis in _AXES),
            *(Channel(f"acceleration_{axis}", "mps2", -strongest, strongest) for axis in _AXES),
        )

    class Parameters(NamedTuple):
        fastest: float  # [rad/s]
        strongest: float  # [m/s2]

    class Memory(NamedTuple):
        """The state at the last reading; ``speeds`` and ``weight`` are along the sensor's axes."""

        time: Array  # (1,) [s], -infinity before the first reading
        facing: Array  # (4,) orientation
        speeds: Array  # (3,) velocity [m/s]
        weight: Array  # (3,) [m/s2], specific force at rest, opposite to gravity

    def start(self) -> tuple[Parameters, Memory]:
        memory = self.Memory(np.array([-math.inf]), np.zeros(4), np.zeros(3), np.zeros(3))
        return self.Parameters(self.rate_max_radps, self.acceleration_max_mps2), memory

    @staticmethod
    def rule(
        parameters: Parameters, memory: Memory, signal: Array, values: Array, time: float
    ) -> None:
        """Compute angular rates from orientations, and accelerations from velocities."""
        facing = signal[ORIENTATION : ORIENTATION + 4]
        qw, qx, qy, qz = facing[0], facing[1], facing[2], facing[3]
        v, w = VELOCITY, TURNING
        rates = to_axes(qw, qx, qy, qz, signal[w], signal[w + 1], signal[w + 2])
        speeds = to_axes(qw, qx, qy, qz, signal[v], signal[v + 1], signal[v + 2])
        weight = to_axes(qw, qx, qy, qz, 0.0, 0.0, signal[GRAVITY])
        elapsed = time - memory.time[0]
        moves = 0.0 < elapsed < math.inf
        if moves:
            rates = turn_between(memory.facing, qw, qx, qy, qz, elapsed)
        for i in range(3):
            felt = weight[i]
            if moves:
                # Components of a constant velocity change along rotating axes.
                j = (i + 1) % 3
                k = (i + 2) % 3
                turned = rates[j] * (speeds[k] + memory.speeds[k])
                turned -= rates[k] * (speeds[j] + memory.speeds[j])
                felt = 0.5 * (weight[i] + memory.weight[i] + turned)
                felt += (speeds[i] - memory.speeds[i]) / elapsed
            values[i] = min(max(rates[i], -parameters.fastest), parameters.fastest)
            values[3 + i] = min(max(felt, -parameters.strongest), parameters.strongest)
        memory.time[0] = time
        for i in range(4):
            memory.facing[i] = facing[i]
        for i in range(3):
            memory.speeds[i] = speeds[i]
            memory.weight[i] = weight[i]

    def gazebo(self, name: str) -> str:
        return gazebo_sensor(name, "imu", self.period_s)


@compilable
def to_axes(
    qw: float, qx: float, qy: float, qz: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Express a world vector in a frame with the orientation (w, x, y, z)."""
    return (
        (1.0 - 2.0 * (qy * qy + qz * qz)) * x
        + 2.0 * (qx * qy + qw * qz) * y
        + 2.0 * (qx * qz - qw * qy) * z,
        2.0 * (qx * qy - qw * qz) * x
        + (1.0 - 2.0 * (qx * qx + qz * qz)) * y
        + 2.0 * (qy * qz + qw * qx) * z,
        2.0 * (qx * qz + qw * qy) * x
        + 2.0 * (qy * qz - qw * qx) * y
        + (1.0 - 2.0 * (qx * qx + qy * qy)) * z,
    )


@compilable
def turn_between(
    before: Array, qw: float, qx: float, qy: float, qz: float, elapsed: float
) -> tuple[float, float, float]:
    """Return the mean rates [rad/s] since orientation ``before``, along the current axes."""
    w, x, y, z = before[0], before[1], before[2], before[3]
    dw = w * qw + x * qx + y * qy + z * qz
    dx = w * qx - x * qw - y * qz + z * qy
    dy = w * qy + x * qz - y * qw - z * qx
    dz = w * qz - x * qy + y * qx - z * qw
    if dw < 0.0:  # the negated quaternion is the same rotation, but the shorter way round
        dw = -dw
        dx = -dx
        dy = -dy
        dz = -dz
    length = math.sqrt(dx * dx + dy * dy + dz * dz)
    rate = 2.0 / elapsed
    if length >= _SMALL_RAD:
        rate = rate * elementary.atan2(length, dw) / length
    return rate * dx, rate * dy, rate * dz
