"""What the sensors of a champion that cast no rays read in a mission, by channel."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from evoros.base.arrays import Array
from evoros.sensor.protocol import name_readings
from evoros.storage.figure_context import Signal

from .designs import read_champion_signals
from .readings import choose_channels
from .records import Record
from .tracks import find_champion_mission, list_failures


class Trace(NamedTuple):
    """The readings of one channel in a mission."""

    label: str  # number of the sensor and name of the channel
    unit: str
    time_s: Array
    values: Array  # NaN where it was silent
    failed_s: float  # when the sensor failed; NaN: it did not


def read_traces(record: Record, world: str) -> list[Trace]:
    """Read what the champion's sensors that cast no rays read in a world, channel by channel.

    Of an IMU, it is the yaw rate and the level accelerations.
    """
    trajectory, context = record.run.trajectory(world), record.context
    failures = list_failures(find_champion_mission(record.run, world))
    failed = {sensor: time for sensor, time, _ in reversed(failures)}
    time = trajectory["time_s"].to_numpy(float)
    sensors = read_champion_signals(record)
    return [
        Trace(label, unit, time, trajectory[column].to_numpy(float), failed.get(number, math.nan))
        for number, kind in zip(sensors["sensor"].tolist(), sensors["type"], strict=True)
        for label, unit, column in _list_columns(number, str(kind), context.signals[kind])
    ]


def _list_columns(number: int, kind: str, signal: Signal) -> Iterator[tuple[str, str, str]]:
    """Yield label, unit and column of each shown channel."""
    columns = list(name_readings(number, signal.channels))
    for place in choose_channels(signal):
        name, unit = signal.channels[place]
        words = name if len(signal.channels) > 1 else kind
        yield f"{number} {words.replace('_', ' ')}", unit, columns[place]
