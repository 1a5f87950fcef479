"""Sensors that cast no rays, as the page of a report plays them."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from evoros.sensor.protocol import CONTACT, name_readings
from evoros.storage.figure_context import FigureContext

from ..tables.readings import choose_channels
from .columns import encode_differences, encode_place, to_thousandths


def describe_signals(sensors: pd.DataFrame, context: FigureContext) -> Iterator[dict[str, Any]]:
    """Describe the place, the zone and the shown channels of each sensor."""
    for row in sensors.to_dict("records"):
        signal = context.signals[row["type"]]
        yield {
            **encode_place(row),
            "touches": signal.measures == CONTACT,
            "width": row["width_m"],
            "depth": row["depth_m"],
            "channels": [signal.channels[place] for place in choose_channels(signal)],
        }


def encode_signals(
    trajectory: pd.DataFrame, sensors: pd.DataFrame, context: FigureContext
) -> list[list[list[int | None]]]:
    """Encode the shown readings by sensor and channel, in thousandths of their unit."""
    encoded = []
    for number, kind in zip(sensors["sensor"].tolist(), sensors["type"], strict=True):
        signal = context.signals[kind]
        names = np.array([*name_readings(number, signal.channels)])[choose_channels(signal)]
        columns = [to_thousandths(trajectory[name].to_numpy(float)) for name in names.tolist()]
        encoded.append([encode_differences(column) for column in columns])
    return encoded
