"""The path of a robot: its stretches, where it starts, and the numbers of sensors along it."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from evoros.base.arrays import Array

_LABEL_M = 1.2  # failures within this distance share a label
_ARROW_M = 1.5  # length of the arrow along the beginning of the path


def split_by_mode(path: pd.DataFrame) -> Iterator[tuple[str, Array]]:
    """Split the path of one mission into consecutive stretches (n, 2) [m] of one mode each.

    From a record to the next the robot does what was decided at the first of the two.
    """
    places, modes = path[["x_m", "y_m"]].to_numpy(float), path["mode"].to_numpy()[:-1]
    begins = [i for i in range(len(modes)) if i == 0 or modes[i] != modes[i - 1]]
    for begin, end in zip(begins, [*begins[1:], len(modes)], strict=True):
        yield str(modes[begin]), places[begin : end + 1]


def draw_arrow(axes: Axes, path: pd.DataFrame) -> None:
    """Draw an arrow from home in the direction of the path."""
    places = path[["x_m", "y_m"]].to_numpy(float)
    distances = np.hypot(*(places - places[0]).T)
    far = distances >= _ARROW_M
    end = places[int(np.argmax(far))] if far.any() else places[-1]
    shape = {"arrowstyle": "-|>", "mutation_scale": 6, "lw": 0.8, "color": "black"}
    axes.annotate("", end, places[0], arrowprops={**shape, "shrinkA": 0, "shrinkB": 0}, zorder=4)


def write_numbers(
    axes: Axes, rows: pd.DataFrame, column: str, offset_pt: tuple[float, float]
) -> None:
    """Write the numbers of sensors in a column beside the places of the rows."""
    style: dict[str, Any] = {"textcoords": "offset points", "fontsize": "small", "zorder": 6}
    for place, text in _group_labels(rows, column):
        axes.annotate(text, place, xytext=offset_pt, **style)


def _group_labels(rows: pd.DataFrame, column: str) -> Iterator[tuple[tuple[float, float], str]]:
    """Yield the numbers of sensors, each once in a label for rows near each other."""
    groups: list[tuple[tuple[float, float], list[str]]] = []
    places = zip(rows["x_m"].tolist(), rows["y_m"].tolist(), strict=True)
    for place, text in zip(places, rows[column].tolist(), strict=True):
        numbers = text.split(";")
        if groups and math.dist(groups[-1][0], place) < _LABEL_M:
            groups[-1][1].extend(numbers)
        else:
            groups.append((place, numbers))
    for place, numbers in groups:
        yield place, ", ".join(dict.fromkeys(numbers))
