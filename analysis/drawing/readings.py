"""Readings of sensors that cast no rays over the time of missions."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure
from matplotlib.lines import Line2D

from ..tables.traces import Trace
from .style import CATEGORIES

UNITS = {
    "mps": "speed\n[m/s]",
    "radps": "rate\n[rad/s]",
    "mps2": "acceleration\n[m/s²]",
    "": "closed",
}
"""The quantity of a channel by its unit, and how that is written; a bumper has none."""
PANEL_IN, LEGEND_IN = 0.85, 0.6  # height of a panel, and of the legend with the time below
_STYLES = ("-", "--", "-.", ":")


def measure_height(traces: Mapping[str, Sequence[Trace]], columns: int) -> float:
    """Return the height [in] of the panels of missions in so many columns."""
    rows = -(-len(traces) // columns)
    return rows * len(_list_units(traces)) * PANEL_IN + LEGEND_IN


def draw_readings(figure: SubFigure, traces: Mapping[str, Sequence[Trace]], columns: int) -> None:
    """Draw a panel for each mission and unit; a triangle is where a sensor failed."""
    units = _list_units(traces)
    rows = -(-len(traces) // columns)
    grid = figure.subplots(rows * len(units), columns, squeeze=False, sharey="row")
    labels = list(dict.fromkeys(trace.label for recorded in traces.values() for trace in recorded))
    styles = {label: _choose_style(place) for place, label in enumerate(labels)}
    for place, recorded in enumerate(traces.values()):
        row, column = divmod(place, columns)
        for step, unit in enumerate(units):
            axes: Axes = grid[row * len(units) + step, column]
            shown = [trace for trace in recorded if trace.unit == unit]
            for order, trace in enumerate(shown):
                _draw_trace(axes, trace, order, styles[trace.label])
            if unit == "":
                axes.set_yticks([order + 0.4 for order in range(len(shown))])
                axes.set_yticklabels([trace.label.split()[0] for trace in shown])
            axes.tick_params(labelbottom=step == len(units) - 1)
            axes.set_ylabel("" if column else UNITS.get(unit, f"[{unit}]"))
            if step == len(units) - 1:
                axes.set_xlabel("time [s]")
    for place in range(len(traces), rows * columns):
        for step in range(len(units)):
            row, column = divmod(place, columns)
            grid[row * len(units) + step, column].set_axis_off()
    handles = [Line2D([], [], label=f"sensor {label}", **style) for label, style in styles.items()]
    across = 5 if columns > 2 else 2
    figure.legend(handles=handles, loc="outside lower center", ncols=across, frameon=False)


def _list_units(traces: Mapping[str, Sequence[Trace]]) -> list[str]:
    return list(dict.fromkeys(trace.unit for recorded in traces.values() for trace in recorded))


def _choose_style(place: int) -> dict[str, Any]:
    colour = CATEGORIES[place % len(CATEGORIES)]
    return {"color": colour, "ls": _STYLES[place // len(CATEGORIES) % len(_STYLES)]}


def _draw_trace(axes: Axes, trace: Trace, order: int, style: Mapping[str, Any]) -> None:
    """Draw a trace; of bumpers, one above the other, else the later ones narrower."""
    if trace.unit == "":
        values = order + 0.8 * trace.values
        axes.fill_between(trace.time_s, order, values, step="post", color=style["color"], lw=0.7)
    else:
        axes.plot(trace.time_s, trace.values, lw=1.0 / (1 + order), **style)
    if np.isfinite(trace.failed_s):
        mark: dict[str, Any] = {"marker": "^", "ms": 5, "mec": "black", "mew": 0.5, "zorder": 5}
        below = axes.get_xaxis_transform()
        axes.plot(trace.failed_s, 0.0, color=style["color"], transform=below, clip_on=False, **mark)
