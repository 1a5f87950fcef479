"""Columns of trajectories as short lists of whole numbers, which the page of a report plays."""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.sensor.protocol import CONTACT
from evoros.storage.figure_context import FigureContext

from ..tables.readings import list_channels

MAX_RECORDS = 6000
"""Maximum number of records of a mission; longer ones are thinned out evenly."""


def thin_out(records: int, most: int = MAX_RECORDS) -> list[int]:
    """Choose at most so many rows, evenly, the first and the last included."""
    places = np.linspace(0, records - 1, min(records, most))
    return [round(place) for place in places.tolist()]


def encode_place(sensor: Mapping[Any, Any]) -> dict[str, Any]:
    """Encode type, number and place of a row of sensors."""
    return {
        "type": str(sensor["type"]),
        "number": int(sensor["sensor"]),
        "x": round(sensor["x_m"], 4),
        "y": round(sensor["y_m"], 4),
        "yaw": round(math.radians(sensor["yaw_deg"]), 4),
    }


def encode_poses(trajectory: pd.DataFrame) -> dict[str, list[int | None]]:
    """Encode the columns ``x``, ``y`` and ``yaw`` of a robot."""
    x, y, yaw = (trajectory[name].to_numpy(float) for name in ("x_m", "y_m", "yaw_rad"))
    return {
        "x": encode_numbers(x),
        "y": encode_numbers(y),
        "yaw": encode_numbers(np.unwrap(yaw)),
    }


def encode_numbers(values: Array) -> list[int | None]:
    """Encode a column in thousandths of its unit."""
    return encode_differences(to_thousandths(values))


def to_thousandths(values: Array) -> list[int | None]:
    """Round values to whole thousandths; NaN becomes None."""
    return [None if math.isnan(value) else round(value * 1000) for value in values.tolist()]


def encode_differences(values: Sequence[int | None]) -> list[int | None]:
    """Subtract from each value the last known one before it; None stays."""
    last, differences = 0, list[int | None]()
    for value in values:
        differences.append(None if value is None else value - last)
        last = last if value is None else value
    return differences


def encode_changes(values: Sequence[int | None]) -> list[list[int | None]]:
    """List ``[index, value]`` of the first value and of each that differs from the previous."""
    changes = [index for index, (a, b) in enumerate(pairwise(values), 1) if a != b]
    return [[index, values[index]] for index in (0, *changes)] if values else []


def describe_signals(sensors: pd.DataFrame, context: FigureContext) -> Iterator[dict[str, Any]]:
    """Describe place, zone and shown channels of each sensor that casts no rays."""
    for row in sensors.to_dict("records"):
        signal = context.signals[row["type"]]
        yield {
            **encode_place(row),
            "touches": signal.measures == CONTACT,
            "width": row["width_m"],
            "depth": row["depth_m"],
            "channels": [channel[:2] for channel in list_channels(row["sensor"], signal)],
        }


def encode_signals(
    trajectory: pd.DataFrame, sensors: pd.DataFrame, context: FigureContext
) -> list[list[list[int | None]]]:
    """Encode the shown readings by sensor and channel, in thousandths of their unit."""
    return [
        [
            encode_numbers(trajectory[column].to_numpy(float))
            for _, _, column in list_channels(sensor, context.signals[kind])
        ]
        for sensor, kind in zip(sensors["sensor"].tolist(), sensors["type"], strict=True)
    ]
