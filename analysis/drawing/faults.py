"""The path of a robot with its faults: failed sensors, wrong readings, failed parts."""

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

from evoros.base.arrays import Array
from evoros.filter.protocol import ALTERS, ENDS, GROWS

from ..tables.tracks import PARTS
from .style import HALO, ORANGE, VERMILLION, YELLOW

_LABEL_M = 1.2  # maximum distance [m] of failures that share a label
DASHES: Mapping[int, Any] = {1: "-", 2: (0, (2.5, 1.0))}  # line style by phase
_HEAD: dict[str, Any] = {"ls": "none", "ms": 4.5, "mec": "black", "mew": 0.5}
_HEADS = {1: {**_HEAD, "mfc": "black"}, 2: {**_HEAD, "mfc": "white"}}
_APART_M, _ARROWHEAD_M = 7.0, 0.3  # distance between arrowheads; path length for their direction
_CLEAR_M = 0.7  # minimum distance [m] between arrowheads of a phase
_ARROW_M = 1.5  # length [m] of the arrow at the start of the path
_POINT: dict[str, Any] = {"ls": "none", "marker": "v", "ms": 5, "mec": "black", "mew": 0.7}
_MARKS: Mapping[str, Mapping[str, Any]] = {
    ENDS: {**_POINT, "mfc": YELLOW},
    ALTERS: {**_POINT, "mfc": "white"},
    GROWS: {**_POINT, "mfc": "white", "marker": "^"},
}
_WORDS = {ENDS: "sensor fails", ALTERS: "sensor error", GROWS: "error starts"}
_PART: dict[str, Any] = {**_POINT, "marker": "D", "ms": 5.5, "mfc": VERMILLION}
_WEDGE: dict[str, Any] = {"color": ORANGE, "alpha": 0.45}
_WIDEST_PT = 6.0  # maximum width [pt] of a growing error's band
GROWN_S = 60.0  # time [s] at which this band reaches its full width
_STRETCHES = 60  # number of segments in a widening band


def draw_faults(axes: Axes, path: pd.DataFrame, effects: Mapping[str, str]) -> None:
    """Mark the failures along a path; a growing error is drawn as a widening band."""
    for effect, rows in _split(path):
        kind = effects.get(effect, ENDS)
        if kind == GROWS:
            _draw_growth(axes, path, int(rows.index[0]))
        label = f"{_WORDS[kind]}: {effect}"
        axes.plot(rows["x_m"], rows["y_m"], zorder=5, label=label, **_MARKS[kind])
        write_numbers(axes, rows, "failed_sensors", (3, 3))
    for _, rows in _split(path, *PARTS):
        axes.plot(rows["x_m"], rows["y_m"], zorder=5.2, **_PART)
        for x, y, parts in zip(rows["x_m"], rows["y_m"], rows[PARTS[0]], strict=True):
            _name_part(axes, (float(x), float(y)), str(parts).replace(";", ", "))


def _name_part(axes: Axes, place: tuple[float, float], name: str) -> None:
    left = place[0] > sum(axes.get_xlim()) / 2
    style: dict[str, Any] = {"ha": "right" if left else "left", "va": "center", "zorder": 6}
    offset = (-6 if left else 6, 0)
    style |= {"textcoords": "offset points", "fontsize": "small", "path_effects": [HALO]}
    axes.annotate(name, place, xytext=offset, **style).set_in_layout(False)


def _split(
    path: pd.DataFrame, failed: str = "failed_sensors", failed_by: str = "failed_by"
) -> Iterator[tuple[str, pd.DataFrame]]:
    """Yield each effect with the rows in which it occurs, which list only failures of this kind."""
    if failed not in path:
        return
    hit = path[path[failed].fillna("") != ""]  # parts of other robots cannot fail
    names = [cell.split(";") for cell in hit[failed_by]]
    for effect in dict.fromkeys(name for cell in names for name in cell):
        numbers = [
            ";".join(n for n, e in zip(numbers.split(";"), by, strict=True) if e == effect)
            for numbers, by in zip(hit[failed], names, strict=True)
        ]
        rows = hit.assign(**{failed: numbers})
        yield effect, rows[rows[failed] != ""]


def _draw_growth(axes: Axes, path: pd.DataFrame, begin: int) -> None:
    rows = path.loc[begin:]
    places: Array = rows[["x_m", "y_m"]].to_numpy(float)
    time_s = rows["time_s"].to_numpy(float)
    cuts = np.unique(np.linspace(0, len(rows) - 1, _STRETCHES + 1).astype(int)).tolist()
    pairs = list(pairwise(cuts))
    if not pairs:
        return
    widths = [_WIDEST_PT * min(1.0, (time_s[b] - time_s[0]) / GROWN_S) for _, b in pairs]
    lines = [places[a : b + 1] for a, b in pairs]
    band = LineCollection(lines, linewidths=widths, zorder=2.2, capstyle="butt", **_WEDGE)
    axes.add_collection(band, autolim=False)


def make_fault_handles(tracks: pd.DataFrame, effects: Mapping[str, str]) -> list[Line2D]:
    """Make a legend entry for each effect, and one for the band of growing errors."""
    drawn = {effect: effects.get(effect, ENDS) for effect, _ in _split(tracks)}
    handles = [
        Line2D([], [], label=f"{_WORDS[kind]}: {effect}", **_MARKS[kind])
        for effect, kind in drawn.items()
    ]
    if GROWS in drawn.values():
        handles.append(Line2D([], [], lw=_WIDEST_PT, label="error grows", **_WEDGE))
    for effect, rows in _split(tracks, *PARTS):
        parts = dict.fromkeys(part for cell in rows[PARTS[0]] for part in str(cell).split(";"))
        label = f"{', '.join(parts)} fails: {effect}"
        handles.append(Line2D([], [], label=label, **_PART))
    return handles


def split_by_mode(path: pd.DataFrame) -> Iterator[tuple[str, Array]]:
    """Split a path into segments (n, 2) [m], each with the mode of its first sample."""
    places, modes = path[["x_m", "y_m"]].to_numpy(float), path["mode"].to_numpy()[:-1]
    begins = [i for i in range(len(modes)) if i == 0 or modes[i] != modes[i - 1]]
    for begin, end in zip(begins, [*begins[1:], len(modes)], strict=True):
        yield str(modes[begin]), places[begin : end + 1]


def split_by_phase(path: pd.DataFrame) -> Iterator[tuple[int, pd.DataFrame]]:
    """Split the path of a mission into phases 1 and 2, which share a point."""
    phases = path["phase"].to_numpy(int) if "phase" in path else np.ones(len(path), dtype=int)
    back = int(np.argmax(phases == 2)) if (phases == 2).any() else len(path)
    yield 1, path.iloc[: back + 1]
    if back < len(path) - 1:
        yield 2, path.iloc[back:]


def draw_direction(axes: Axes, path: pd.DataFrame, phase: int) -> None:
    """Draw arrowheads along the path of a phase."""
    places = path[["x_m", "y_m"]].to_numpy(float)
    way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))])
    count, heads = int(way[-1] / _APART_M), list[list[float]]()
    for target in (np.arange(count) + 0.5) * way[-1] / max(count, 1):
        row = int(np.searchsorted(way, target))
        if any(math.dist(head, places[row]) < _CLEAR_M for head in heads):
            continue  # the arrowheads of a circling robot would hide its path
        heads.append(places[row].tolist())
        before = int(np.searchsorted(way, target - _ARROWHEAD_M))
        x, y = (places[row] - places[min(before, row - 1)]).tolist()
        turn = math.degrees(math.atan2(y, x)) - 90.0
        axes.plot(*places[row], marker=(3, 0, turn), zorder=4.2, **_HEADS[phase])


def make_phase_handles(tracks: pd.DataFrame) -> list[Line2D]:
    """Make the legend entries for the phases; none if there is a single phase."""
    worlds = [rows for _, rows in tracks.groupby("world")]
    phases = {phase for rows in worlds for phase, _ in split_by_phase(rows)}
    words = {1: "first phase", 2: "second phase"}
    return [
        Line2D([], [], color="0.3", lw=1.0, marker=(3, 0, -90), label=words[phase], **look)
        for phase in sorted(phases)
        for look in [{**_HEADS[phase], "ls": DASHES[phase]}]
        if len(phases) > 1
    ]


def draw_arrow(axes: Axes, path: pd.DataFrame) -> None:
    """Draw an arrow at home in the direction of the path."""
    places = path[["x_m", "y_m"]].to_numpy(float)
    distances = np.hypot(*(places - places[0]).T)
    far = distances >= _ARROW_M
    end = places[int(np.argmax(far))] if far.any() else places[-1]
    shape = {"arrowstyle": "-|>", "mutation_scale": 6, "lw": 0.8, "color": "black"}
    axes.annotate("", end, places[0], arrowprops={**shape, "shrinkA": 0, "shrinkB": 0}, zorder=4)


def write_numbers(
    axes: Axes, rows: pd.DataFrame, column: str, offset_pt: tuple[float, float]
) -> None:
    """Write the sensor numbers of a column next to the positions of the rows."""
    style: dict[str, Any] = {"textcoords": "offset points", "fontsize": "small", "zorder": 6}
    style["path_effects"] = [HALO]
    for place, text in _group_labels(rows, column):
        axes.annotate(text, place, xytext=offset_pt, **style)


def _group_labels(rows: pd.DataFrame, column: str) -> Iterator[tuple[tuple[float, float], str]]:
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
