"""How many champions, or sensors, cover each place around a robot: as a table and as an array."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.storage.figure_context import FigureContext

from .cones import Window, find_covered, fit_window

CELLS = 300  # along a cone: about 0.1 mm each in print
SPAN = ["treatment", "cut_m", "cell_m", "x_m", "y_low_m", "y_high_m"]
UNITS = {"champions": ["run"], "sensors": ["run", "sensor"]}
"""The units of the counts, and the columns that identify them."""


def choose_unit(sensors: pd.DataFrame) -> str:
    """Choose champions as the unit, or sensors if no treatment has two champions."""
    return "champions" if sensors.groupby("treatment").run.nunique().max() > 1 else "sensors"


def count_coverage(
    sensors: pd.DataFrame, contexts: Mapping[str, FigureContext], cuts_m: Sequence[float]
) -> pd.DataFrame:
    """Count the units that cover each place: a row for each span of places with equal counts.

    ``docs/analysis.md`` describes the columns. A place is covered if a cone contains the centre of
    its square cell.
    """
    unit = choose_unit(sensors)
    placed = sensors.dropna(subset="x_m")
    spans = [
        _spans(placed[placed.treatment == treatment], context, cut, unit).assign(
            treatment=treatment
        )
        for treatment, context in contexts.items()
        for cut in cuts_m
    ]
    order = [*SPAN, unit]
    return pd.concat(spans, ignore_index=True)[order] if spans else pd.DataFrame(columns=order)


def _spans(sensors: pd.DataFrame, context: FigureContext, cut: float, unit: str) -> pd.DataFrame:
    cell = cut / CELLS
    x, y = cell_centres(fit_window([context], sensors, cut), cell)
    along, across = np.meshgrid(x, y, indexing="ij")
    count = np.zeros((len(x), len(y)), dtype=np.int64)
    for _, members in sensors.groupby(UNITS[unit]):
        count += find_covered(members, along, across, cell, cut).astype(np.int64)
    edges = np.pad(count, ((0, 0), (1, 1)))
    row, first = np.nonzero(edges[:, 1:] != edges[:, :-1])  # where the count changes
    last = np.where(np.diff(row, append=-1), 0, np.roll(first, -1))
    span = last > first
    row, first, last = row[span], first[span], last[span]
    table = {"cut_m": cut, "cell_m": cell, "x_m": x[row], unit: count[row, first]}
    low, high = (y[0] + (end - 0.5) * cell for end in (first, last))
    spans = pd.DataFrame(table | {"y_low_m": low.round(9), "y_high_m": high.round(9)})
    return spans[spans[unit] > 0]


def cell_centres(view: Window, cell_m: float) -> tuple[Array, Array]:
    """Return the centres [m] of the cells that fill a window; the axes are borders of cells."""
    x_low, x_high, y_low, y_high = (edge / cell_m for edge in view)
    x = np.arange(math.floor(x_low), math.ceil(x_high), dtype=np.float64)
    y = np.arange(math.floor(y_low), math.ceil(y_high), dtype=np.float64)
    return ((x + 0.5) * cell_m).round(9), ((y + 0.5) * cell_m).round(9)


def rasterize(cover: pd.DataFrame, x: Array, y: Array) -> np.ma.MaskedArray[Any, Any]:
    """Return the counts (n, m) at cell centres x (n,) and y (m,) [m]; masked where it is 0."""
    cell = float(cover.cell_m.iloc[0])
    count = np.zeros((len(x), len(y)), dtype=np.int64)
    rows = np.rint((cover.x_m - x[0]) / cell).astype(int)
    low, high = (
        np.rint((cover[end] - y[0]) / cell + 0.5).astype(int) for end in ("y_low_m", "y_high_m")
    )
    for row, first, last, units in zip(rows, low, high, cover.iloc[:, -1], strict=True):
        count[row, first:last] = units
    masked: np.ma.MaskedArray[Any, Any] = np.ma.masked_equal(count, 0)
    return masked
