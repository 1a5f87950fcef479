"""Sensor readings and walker tracks of trajectories."""

import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.formats.sdf.actors import HEIGHT_M, RADIUS_M
from evoros.mission.mission import WALKER
from evoros.sensor.protocol import MOTION, find_prefix, name_readings
from evoros.storage.figure_context import Beam, FigureContext, Signal
from evoros.walkers.crowd import has_touched

from .agents import list_robots
from .champions import find_shown, read_champion_signals
from .records import Record
from .tracks import list_failures, read_mission

_LEVEL = ("rate_z", "acceleration_x", "acceleration_y")  # channels of an IMU that are plotted
_MOST = 6  # maximum number of plotted channels per sensor
_RANGE = re.compile(r"range_(\d+)(?:_\d+)?_m")


def group_ranges(trajectory: pd.DataFrame) -> dict[int, Array]:
    """Return the ranges (rows, channels) [m] of each range sensor, by sensor number."""
    columns: dict[int, list[str]] = {}
    for name in map(str, trajectory.columns):
        if match := _RANGE.fullmatch(name):
            columns.setdefault(int(match[1]), []).append(name)
    return {sensor: trajectory[columns[sensor]].to_numpy(float) for sensor in sorted(columns)}


@dataclass(frozen=True, eq=False)
class RecordedSensor:
    """A mounted sensor and its readings."""

    link: str  # name of the link: sensor type and number
    type: str
    kind: Beam | Signal
    readings: Array  # (rows, channels)


def read_sensors(
    trajectory: pd.DataFrame, links: Collection[str], context: FigureContext, source: str
) -> list[RecordedSensor]:
    """Return all sensors with readings of a robot; ``source`` names the origin of ``links``."""
    prefix = find_prefix(links, context.types)
    types = _find_types(links, context.types, prefix)
    ranges = group_ranges(trajectory)
    seeing = [sensor for sensor, name in enumerate(types) if name in context.beams]
    if [*ranges] != seeing:
        wanted, linked = (", ".join(map(str, sensors)) or "none" for sensors in (ranges, seeing))
        raise InputError(
            f"{source}: the trajectory has ranges of the sensors {wanted}, but the robot has links "
            f"for {linked}; give the description of the robot that ran the mission"
        )
    sensors = []
    for i, name in enumerate(types):
        kind = context.beams.get(name) or context.signals[name]
        if isinstance(kind, Signal):
            columns = list(name_readings(i, kind.channels))
            if not {*columns} <= {*trajectory}:
                raise InputError(
                    f"{source}: the trajectory lacks the columns of the sensor {name}_{i}: "
                    f"{', '.join(columns)}; give the description of the robot that ran the mission"
                )
            ranges[i] = trajectory[columns].to_numpy(float)
        sensors.append(RecordedSensor(f"{prefix}{name}_{i}", name, kind, ranges[i]))
    return sensors


def _find_types(links: Collection[str], types: Sequence[str], prefix: str) -> list[str]:
    mounted: list[str] = []
    while name := next((t for t in types if f"{prefix}{t}_{len(mounted)}" in links), None):
        mounted.append(name)
    return mounted


def find_nearest(ranges: Array) -> Array:
    """Return the minimum range (rows,) of all channels; NaN if all are silent."""
    return np.asarray(np.fmin.reduce(ranges, axis=1))


def merge_sectors(ranges: Array, bearings_deg: Sequence[float], most: int) -> list[Array]:
    """Return the minimum ranges (rows,) of up to ``most`` equal groups of beams, right to left."""
    ordered = np.argsort(bearings_deg, kind="stable")
    sectors = np.array_split(ordered, min(most, len(ordered)))
    return [find_nearest(ranges[:, sector]) for sector in sectors]


def list_channels(sensor: int, signal: Signal) -> list[tuple[str, str, str]]:
    """Return the name, unit and column of each plotted channel of a sensor."""
    columns = name_readings(sensor, signal.channels)
    channels = [(*channel, name) for channel, name in zip(signal.channels, columns, strict=True)]
    by_name = {channel[0]: channel for channel in channels}
    level = [by_name[name] for name in _LEVEL if name in by_name]
    return level if signal.measures == MOTION and level else channels[:_MOST]


class Trace(NamedTuple):
    """The readings of a channel in a mission."""

    label: str  # sensor number and channel name
    unit: str
    time_s: Array
    values: Array  # NaN while the sensor is silent
    failed_s: float  # onset of the sensor's failure; NaN if it does not fail


def read_traces(record: Record, world: str) -> list[Trace]:
    """Read the traces in a world; an IMU has yaw rate and horizontal accelerations."""
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


COLUMNS = ("world", "walker", "radius_m", "time_s", "x_m", "y_m", "touched_by")


class WalkerTrack(NamedTuple):
    """The track of a walker in a mission."""

    name: str
    radius_m: float
    height_m: float
    time_s: Array
    places: Array  # (n, 2) [m]
    touched_by: Array  # (n,) sum of 2**i over all robots i touched so far

    def find_touch(self, robot: int) -> int | None:
        """Return the index of the first contact with the robot, or None."""
        touched = [has_touched(report, robot) for report in self.touched_by.tolist()]
        return touched.index(True) if any(touched) else None


def list_walkers(trajectory: pd.DataFrame, values: Mapping[str, Any]) -> list[WalkerTrack]:
    """Return the walkers of a mission; ``values`` is the configuration of its run."""
    tracks = []
    time = trajectory["time_s"].to_numpy(float)
    for column in map(str, trajectory.columns):
        match = re.fullmatch(rf"{re.escape(WALKER)}(.+)\.x_m", column)
        if match is None or trajectory[column].isna().all():
            continue
        name = match[1]
        columns = [f"{WALKER}{name}.{part}" for part in ("x_m", "y_m", "touched_by")]
        numbers = trajectory[columns].to_numpy(float)
        group = name.rpartition("_")[0]
        # Actors, and groups missing in the configuration, have the size of a person.
        radius = values.get(f"walkers.{group}.radius_m", RADIUS_M)
        height = values.get(f"walkers.{group}.height_m", HEIGHT_M)
        size = float(radius), float(height)
        tracks.append(WalkerTrack(name, *size, time, numbers[:, :2], numbers[:, 2]))
    return tracks


def read_walkers(record: Record, world: str) -> list[WalkerTrack]:
    """Read the walkers of the champion's mission in a world."""
    whole = list_robots(record)[0]
    _, trajectory = read_mission(whole.run, world, find_shown(record))
    return list_walkers(trajectory, record.values)


def to_table(walkers: Mapping[str, Iterable[WalkerTrack]]) -> pd.DataFrame:
    """Return the tracks of walkers in each world as a table with ``COLUMNS``."""
    parts = [
        pd.DataFrame(
            {
                "world": world,
                "walker": walker.name,
                "radius_m": walker.radius_m,
                "time_s": walker.time_s,
                "x_m": walker.places[:, 0],
                "y_m": walker.places[:, 1],
                "touched_by": walker.touched_by.astype(np.int64),
            }
        )
        for world, tracks in walkers.items()
        for walker in tracks
    ]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=[*COLUMNS])
