"""How many champions, or sensors, cover each place around a robot: as a table, as an array.

Overlapping translucent cones would tell no number: the shade of a place is a count.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.storage.figure_context import FigureContext

from ..drawing.robot import Window, covered, window

CELLS = 300  # along a cone: about 0.1 mm each in print
SPAN = ["treatment", "cut_m", "cell_m", "x_m", "y_low_m", "y_high_m"]
COUNTED = {"champions": ["run"], "sensors": ["run", "sensor"]}
"""What may be counted, and the columns that tell one from another."""


def counted(sensors: pd.DataFrame) -> str:
    """What is worth counting: champions, or sensors where no treatment has two champions."""
    return "champions" if sensors.groupby("treatment").run.nunique().max() > 1 else "sensors"


def coverage(
    sensors: pd.DataFrame, settings: Mapping[str, FigureContext], cuts_m: Sequence[float]
) -> pd.DataFrame:
    """How many of what is ``counted`` cover each place: a row for each span of equal number.

    ``sensors`` has the columns of ``designs.py``, ``settings`` the setting of each treatment.
    Columns: ``treatment``; ``cut_m``, where cones are cut; ``cell_m``, the width of the strip along
    y that the span is part of; ``x_m``, its middle, and from ``y_low_m`` to ``y_high_m``, in the
    robot's frame; at last ``champions`` with a sensor, or ``sensors``, whose cones have the centres
    of the span's square cells in them, at least one.
    """
    unit = counted(sensors)
    placed = sensors.dropna(subset="x_m")
    spans = [
        _spans(placed[placed.treatment == treatment], setting, cut, unit).assign(
            treatment=treatment
        )
        for treatment, setting in settings.items()
        for cut in cuts_m
    ]
    order = [*SPAN, unit]
    return pd.concat(spans, ignore_index=True)[order] if spans else pd.DataFrame(columns=order)


def _spans(sensors: pd.DataFrame, setting: FigureContext, cut: float, unit: str) -> pd.DataFrame:
    cell = cut / CELLS
    x, y = cells(window([setting], sensors, cut), cell)
    along, across = np.meshgrid(x, y, indexing="ij")
    count = np.zeros((len(x), len(y)), dtype=np.int64)
    for _, each in sensors.groupby(COUNTED[unit]):
        count += covered(each, along, across, cell, cut).astype(np.int64)
    edges = np.pad(count, ((0, 0), (1, 1)))
    row, first = np.nonzero(edges[:, 1:] != edges[:, :-1])  # where another number begins
    last = np.where(np.diff(row, append=-1), 0, np.roll(first, -1))
    span = last > first
    row, first, last = row[span], first[span], last[span]
    table = {"cut_m": cut, "cell_m": cell, "x_m": x[row], unit: count[row, first]}
    low, high = (y[0] + (end - 0.5) * cell for end in (first, last))
    found = pd.DataFrame(table | {"y_low_m": low.round(9), "y_high_m": high.round(9)})
    return found[found[unit] > 0]


def cells(view: Window, cell_m: float) -> tuple[Array, Array]:
    """The centres of the cells that fill a window, along x and along y [m]; 0 is a border."""
    x_low, x_high, y_low, y_high = (edge / cell_m for edge in view)
    x = np.arange(math.floor(x_low), math.ceil(x_high), dtype=np.float64)
    y = np.arange(math.floor(y_low), math.ceil(y_high), dtype=np.float64)
    return ((x + 0.5) * cell_m).round(9), ((y + 0.5) * cell_m).round(9)


def raster(cover: pd.DataFrame, x: Array, y: Array) -> np.ma.MaskedArray[Any, Any]:
    """The counts at the centres x (n,) and y (m,) of cells, (n, m); masked where there is none.

    ``cover`` has rows of ``coverage`` of one treatment and cut, at least one.
    """
    cell = float(cover.cell_m.iloc[0])
    count = np.zeros((len(x), len(y)), dtype=np.int64)
    rows = np.rint((cover.x_m - x[0]) / cell).astype(int)
    low, high = (
        np.rint((cover[end] - y[0]) / cell + 0.5).astype(int) for end in ("y_low_m", "y_high_m")
    )
    for row, first, last, number in zip(rows, low, high, cover.iloc[:, -1], strict=True):
        count[row, first:last] = number
    covered_somehow: np.ma.MaskedArray[Any, Any] = np.ma.masked_equal(count, 0)
    return covered_somehow
