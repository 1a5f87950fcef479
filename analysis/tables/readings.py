"""The readings in a trajectory, by sensor."""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.sensor.names import find_prefix
from evoros.sensor.protocol import MOTION, name_readings
from evoros.storage.figure_context import Beam, FigureContext, Signal

_LEVEL = ("rate_z", "acceleration_x", "acceleration_y")
"""What is shown of an IMU: pictures of missions are from above."""
_MOST = 6  # channels of one sensor that are shown
_RANGE = re.compile(r"range_(\d+)(?:_\d+)?_m")


def group_ranges(trajectory: pd.DataFrame) -> dict[int, Array]:
    """Return the ranges (rows, channels) [m] of each range sensor by its number."""
    columns: dict[int, list[str]] = {}
    for name in map(str, trajectory.columns):
        match = _RANGE.fullmatch(name)
        if match:
            columns.setdefault(int(match[1]), []).append(name)
    return {number: trajectory[columns[number]].to_numpy(float) for number in sorted(columns)}


@dataclass(frozen=True, eq=False)
class RecordedSensor:
    """A mounted sensor with its readings; its number is its place among the sensors."""

    link: str  # of the robot: its type and number
    type: str
    kind: Beam | Signal
    readings: Array  # (rows, channels)


def read_sensors(
    trajectory: pd.DataFrame, links: Collection[str], context: FigureContext, source: str
) -> list[RecordedSensor]:
    """Return all sensors of a robot in their order, with their readings.

    ``links`` are those of the robot, which ``source`` describes.
    """
    prefix = find_prefix(links, context.types)
    types = _find_types(links, context.types, prefix)
    ranges = group_ranges(trajectory)
    seeing = [number for number, name in enumerate(types) if name in context.beams]
    if [*ranges] != seeing:
        wanted, found = (", ".join(map(str, numbers)) or "none" for numbers in (ranges, seeing))
        raise InputError(
            f"{source}: must have links of the sensors {wanted}, which have ranges in the "
            f"trajectory, but has those of {found}; give the description of the robot that ran "
            f"the mission"
        )
    return [
        RecordedSensor(f"{prefix}{name}_{n}", name, context.beams[name], ranges[n])
        if name in context.beams
        else RecordedSensor(
            f"{prefix}{name}_{n}",
            name,
            context.signals[name],
            _read_signal(trajectory, n, name, context.signals[name], source),
        )
        for n, name in enumerate(types)
    ]


def _find_types(links: Collection[str], types: Sequence[str], prefix: str) -> list[str]:
    """Find the type of each mounted sensor, whose link is named by its type and number."""
    found: list[str] = []
    while name := next((t for t in types if f"{prefix}{t}_{len(found)}" in links), None):
        found.append(name)
    return found


def _read_signal(
    trajectory: pd.DataFrame, number: int, name: str, signal: Signal, source: str
) -> Array:
    """Return the readings of a sensor that casts no rays."""
    columns = list(name_readings(number, signal.channels))
    if not {*columns} <= {*trajectory}:
        raise InputError(
            f"{source}: has the sensor {name}_{number}, so that the trajectory must have the "
            f"columns {', '.join(columns)}; give the description of the robot that ran the mission"
        )
    return trajectory[columns].to_numpy(float)


def find_nearest(ranges: Array) -> Array:
    """Return the nearest of the ranges (rows, channels) in each row; NaN if all are silent."""
    return np.asarray(np.fmin.reduce(ranges, axis=1))


def merge_sectors(ranges: Array, bearings_deg: Sequence[float], most: int) -> list[Array]:
    """Return the nearest ranges (rows,) in sectors of equal width, from the right to the left.

    Each sector has a range at least, so that there are at most as many as ranges, or ``most``.
    """
    ordered = np.argsort(bearings_deg, kind="stable")
    sectors = np.array_split(ordered, min(most, len(ordered)))
    return [find_nearest(ranges[:, sector]) for sector in sectors]


def choose_channels(signal: Signal) -> list[int]:
    """Choose the channels that are shown over time, by their place."""
    names = [name for name, _ in signal.channels]
    level = [names.index(name) for name in _LEVEL if name in names]
    return level if signal.measures == MOTION and level else [*range(min(len(names), _MOST))]
