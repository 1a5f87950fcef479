"""Robots beside the first one on the map of a mission: their paths, and where they met it."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D

from evoros.base.arrays import Array
from evoros.storage.figure_context import FigureContext

from ..designs.cones import outline_part
from .style import ORANGE, PURPLE, SKY

POSE = ("x_m", "y_m", "yaw_rad")
COLOURS = (ORANGE, SKY, PURPLE)  # the paths of the first robot have others, if it has few modes
DASHES = ((0, (4, 1)), (0, (4, 1, 1, 1)), (0, (1.5, 1)))
_WIDTH_PT = 1.3
_HIT: dict[str, Any] = {"mfc": "black", "mec": "white", "mew": 0.6}
_MEETING: dict[str, Any] = {"marker": "s", "mfc": "white", "mec": "black", "ms": 5}
_NEAR_LABEL: dict[str, Any] = {"textcoords": "offset points", "fontsize": "small", "zorder": 6}


def draw_companions(
    axes: Axes,
    path: pd.DataFrame,
    others: Mapping[str, pd.DataFrame],
    robots: Mapping[str, FigureContext],
) -> None:
    """Draw the paths of the other robots, and where each was nearest to the first one."""
    for place, (name, other) in enumerate(others.items()):
        if len(path) and len(other):
            style = _choose_style(place)
            draw_path(axes, other, style)
            draw_meeting(axes, (path, other), (robots[""], robots[name]), style["color"])


def _choose_style(place: int) -> dict[str, Any]:
    """Choose the line of a robot: colours and dashes tell them apart, in grey as well."""
    colour, dashes = COLOURS[place % len(COLOURS)], DASHES[place % len(DASHES)]
    return {"color": colour, "ls": dashes, "lw": _WIDTH_PT}


def draw_path(axes: Axes, path: pd.DataFrame, style: Mapping[str, Any]) -> None:
    """Draw the path of a robot, from its home, a star, to the end, with its collisions."""
    axes.plot(path["x_m"], path["y_m"], zorder=2.4, **style)
    x, y = path["x_m"].iloc[0], path["y_m"].iloc[0]
    axes.plot(x, y, marker="*", mfc=style["color"], mec="black", mew=0.4, ms=7, zorder=5)
    hits = path[path["contact"].diff().fillna(path["contact"]) > 0]
    axes.plot(hits["x_m"], hits["y_m"], ls="none", marker="X", ms=7, zorder=5, **_HIT)


def draw_meeting(
    axes: Axes, paths: Sequence[pd.DataFrame], robots: Sequence[FigureContext], colour: str
) -> None:
    """Draw two robots, the first one white, where they are nearest to each other, with the time."""
    both = paths[0].merge(paths[1], on="time_s", suffixes=("", "_other"))
    first = both[[*POSE]].to_numpy(float)
    other = both[[f"{name}_other" for name in POSE]].to_numpy(float)
    row = int(np.argmin(np.hypot(*(first - other)[:, :2].T)))
    draw_outline(axes, robots[0], first[row].tolist(), "white")
    draw_outline(axes, robots[1], other[row].tolist(), colour)
    x, y = ((first[row] + other[row]) / 2).tolist()[:2]
    time_s = float(both["time_s"].to_numpy(float)[row])
    axes.annotate(f"{time_s:.0f} s", (x, y), xytext=(7, 5), **_NEAR_LABEL)


def draw_outline(axes: Axes, robot: FigureContext, pose: Sequence[float], colour: str) -> None:
    """Draw a robot from above at a pose x, y [m], yaw [rad]."""
    parts = sorted(robot.parts, key=lambda part: part.top_m)
    areas = [_place(outline_part(part), pose) for part in parts]
    colours = ["0.25" if part.wheel else colour for part in parts]
    axes.add_collection(
        PolyCollection(areas, facecolors=colours, edgecolors="black", linewidths=0.4, zorder=4.5),
        autolim=False,
    )


def _place(points: Array, pose: Sequence[float]) -> Array:
    x, y, yaw = pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    placed: Array = points @ np.array([[cos, sin], [-sin, cos]]) + np.array([x, y])
    return placed


def make_companion_handles(names: Sequence[str]) -> list[Line2D]:
    """Make the legend entries of the other robots."""
    handles = [Line2D([], [], label=name, **_choose_style(i)) for i, name in enumerate(names)]
    if handles:
        handles.append(Line2D([], [], ls="none", label="nearest (time)", **_MEETING))
    return handles
