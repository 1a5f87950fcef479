"""Readings over time of a champion's sensors that cast no rays, by channel."""

import math
from typing import NamedTuple

from evoros.base.arrays import Array

from .champions import find_shown, read_champion_signals
from .readings import list_channels
from .records import Record
from .tracks import list_failures, read_mission


class Trace(NamedTuple):
    """The readings of one channel in a mission."""

    label: str  # number of the sensor and name of the channel
    unit: str
    time_s: Array
    values: Array  # NaN where it was silent
    failed_s: float  # when the sensor failed; NaN: it did not


def read_traces(record: Record, world: str) -> list[Trace]:
    """Read the traces of a world; an IMU has its yaw rate and level accelerations."""
    mission, trajectory = read_mission(record.run, world, find_shown(record))
    context, failures = record.context, list_failures(mission)
    failed = {sensor: time for sensor, time, _ in reversed(failures)}
    time = trajectory["time_s"].to_numpy(float)
    sensors, traces = read_champion_signals(record), []
    for sensor, kind in zip(sensors["sensor"].tolist(), sensors["type"].astype(str), strict=True):
        signal = context.signals[kind]
        for name, unit, column in list_channels(sensor, signal):
            words = (name if len(signal.channels) > 1 else kind).replace("_", " ")
            values = trajectory[column].to_numpy(float)
            failed_s = failed.get(sensor, math.nan)
            traces.append(Trace(f"{sensor} {words}", unit, time, values, failed_s))
    return traces
