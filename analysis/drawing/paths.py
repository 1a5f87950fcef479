"""The path of a robot: its stretches, where it starts, and the numbers of sensors along it."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from evoros.base.arrays import Array

_LABEL_M = 1.2  # failures within this distance share a label
DASHES: Mapping[int, Any] = {1: "-", 2: (0, (2.5, 1.0))}
"""The line of each phase of a mission."""
_HEAD: dict[str, Any] = {"ls": "none", "ms": 4.5, "mec": "black", "mew": 0.5}
_HEADS = {1: {**_HEAD, "mfc": "black"}, 2: {**_HEAD, "mfc": "white"}}
_APART_M, _ARROWHEAD_M = 7.0, 0.3  # from arrowhead to arrowhead, and what gives their direction
_ARROW_M = 1.5  # length of the arrow along the beginning of the path


def split_by_mode(path: pd.DataFrame) -> Iterator[tuple[str, Array]]:
    """Split a path into stretches (n, 2) [m] of one mode each, decided at their first record."""
    places, modes = path[["x_m", "y_m"]].to_numpy(float), path["mode"].to_numpy()[:-1]
    begins = [i for i in range(len(modes)) if i == 0 or modes[i] != modes[i - 1]]
    for begin, end in zip(begins, [*begins[1:], len(modes)], strict=True):
        yield str(modes[begin]), places[begin : end + 1]


def split_by_phase(path: pd.DataFrame) -> Iterator[tuple[int, pd.DataFrame]]:
    """Split the path of one mission into its phases, 1 and 2; a place is the end and the begin."""
    phases = path["phase"].to_numpy(int) if "phase" in path else np.ones(len(path), dtype=int)
    back = int(np.argmax(phases == 2)) if (phases == 2).any() else len(path)
    yield 1, path.iloc[: back + 1]
    if back < len(path) - 1:
        yield 2, path.iloc[back:]


def draw_direction(axes: Axes, path: pd.DataFrame, phase: int) -> None:
    """Draw arrowheads along the way of a phase."""
    places = path[["x_m", "y_m"]].to_numpy(float)
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))])
    count = int(way[-1] / _APART_M)
    for target in (np.arange(count) + 0.5) * way[-1] / max(count, 1):
        row = int(np.searchsorted(way, target))
        before = int(np.searchsorted(way, target - _ARROWHEAD_M))
        x, y = (places[row] - places[min(before, row - 1)]).tolist()
        turn = math.degrees(math.atan2(y, x)) - 90.0
        axes.plot(*places[row], marker=(3, 0, turn), zorder=4.2, **_HEADS[phase])


def make_phase_handles(tracks: pd.DataFrame) -> list[Line2D]:
    """Make the legend entries of the phases that were driven; none of a single one."""
    phases = set(tracks["phase"]) if "phase" in tracks else {1}
    words = {1: "first phase", 2: "second phase, backwards"}
    return [
        Line2D([], [], color="0.3", lw=1.0, marker=(3, 0, -90), label=words[phase], **look)
        for phase in sorted(phases)
        for look in [{**_HEADS[phase], "ls": DASHES[phase]}]
        if len(phases) > 1
    ]


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
