"""Faults along the path of a mission: sudden ends, other readings, slow growth; other parts."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from evoros.base.arrays import Array
from evoros.filter.protocol import ALTERS, ENDS, GROWS

from ..tables.tracks import PARTS
from .paths import write_numbers
from .style import ORANGE, VERMILLION, YELLOW

_POINT: dict[str, Any] = {"ls": "none", "marker": "v", "ms": 5, "mec": "black", "mew": 0.7}
_MARKS: Mapping[str, Mapping[str, Any]] = {
    ENDS: {**_POINT, "mfc": YELLOW},
    ALTERS: {**_POINT, "mfc": "white"},
    GROWS: {**_POINT, "mfc": "white", "marker": "^"},
}
_WORDS = {
    ENDS: "sensor fails: {} (number)",
    ALTERS: "sensor errs: {} (number)",
    GROWS: "error begins: {} (sensor)",
}
_PART: dict[str, Any] = {**_POINT, "marker": "D", "ms": 5.5, "mfc": VERMILLION}
_WEDGE: dict[str, Any] = {"color": ORANGE, "alpha": 0.45}
_WIDEST_PT = 6.0  # of the band along the path while a fault grows
GROWN_S = 60.0
"""Seconds after which an error that grows is drawn in full."""
_STRETCHES = 60  # of a band, which widen


def draw_faults(axes: Axes, path: pd.DataFrame, effects: Mapping[str, str]) -> None:
    """Draw where sensors failed; a band widens along a fault that grows, by ``effects``."""
    for effect, rows in _split(path):
        kind = effects.get(effect, ENDS)
        if kind == GROWS:
            _draw_growth(axes, path, int(rows.index[0]))
        label = _WORDS[kind].format(effect)
        axes.plot(rows["x_m"], rows["y_m"], zorder=5, label=label, **_MARKS[kind])
        write_numbers(axes, rows, "failed_sensors", (3, 3))
    for _, rows in _split(path, *PARTS):
        axes.plot(rows["x_m"], rows["y_m"], zorder=5.2, **_PART)
        for x, y, parts in zip(rows["x_m"], rows["y_m"], rows[PARTS[0]], strict=True):
            _name_part(axes, (float(x), float(y)), str(parts).replace(";", ", "))


def _name_part(axes: Axes, place: tuple[float, float], name: str) -> None:
    """Write the name of a part beside a place, towards the middle of the map."""
    left = place[0] > sum(axes.get_xlim()) / 2
    style: dict[str, Any] = {"ha": "right" if left else "left", "va": "center", "zorder": 6}
    halo = [withStroke(linewidth=2.0, foreground="white")]
    offset = (-6 if left else 6, 0)
    style |= {"textcoords": "offset points", "fontsize": "small", "path_effects": halo}
    axes.annotate(name, place, xytext=offset, **style).set_in_layout(False)


def _split(
    path: pd.DataFrame, failed: str = "failed_sensors", failed_by: str = "failed_by"
) -> Iterator[tuple[str, pd.DataFrame]]:
    """Yield the rows with failures for each effect, with what it has hit alone."""
    if failed not in path:
        return
    hit = path[path[failed].fillna("") != ""]  # empty: another robot, whose parts cannot fail
    names = [cell.split(";") for cell in hit[failed_by]]
    for effect in dict.fromkeys(name for cell in names for name in cell):
        numbers = [
            ";".join(n for n, e in zip(numbers.split(";"), by, strict=True) if e == effect)
            for numbers, by in zip(hit[failed], names, strict=True)
        ]
        rows = hit.assign(**{failed: numbers})
        yield effect, rows[rows[failed] != ""]


def _draw_growth(axes: Axes, path: pd.DataFrame, begin: int) -> None:
    """Draw a band along the path from a row on, which widens with time."""
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
    """Make a legend entry for each effect, and one for the band of those that grow."""
    drawn = {effect: effects.get(effect, ENDS) for effect, _ in _split(tracks)}
    handles = [
        Line2D([], [], label=_WORDS[kind].format(effect), **_MARKS[kind])
        for effect, kind in drawn.items()
    ]
    if GROWS in drawn.values():
        handles.append(Line2D([], [], lw=_WIDEST_PT, label="error grows", **_WEDGE))
    for effect, rows in _split(tracks, *PARTS):
        parts = dict.fromkeys(part for cell in rows[PARTS[0]] for part in str(cell).split(";"))
        label = f"{', '.join(parts)} fails: {effect}"
        handles.append(Line2D([], [], label=label, **_PART))
    return handles
