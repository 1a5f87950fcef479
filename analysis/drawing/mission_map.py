"""One mission on the map: its path by mode, collisions, failures, and its legend."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from evoros.world.model import World

from ..tables.tracks import NONE, TOUCHED
from .drift import ESTIMATED, draw_estimate, has_estimate
from .faults import draw_faults, make_fault_handles
from .paths import (
    DASHES,
    draw_arrow,
    draw_direction,
    make_phase_handles,
    split_by_mode,
    split_by_phase,
    write_numbers,
)
from .style import BLUE, GREEN, PURPLE, VERMILLION
from .worlds import draw_course, draw_obstacles

OBSTACLE = "0.8"
PATHS = ((VERMILLION, 1.6), (BLUE, 0.8), (GREEN, 1.2), (PURPLE, 1.6))
"""Colour and width [pt] of each mode, in the order of the controller's layers."""
UNDECIDED = ("0.3", 0.8)
_POINT: dict[str, Any] = {"ls": "none", "zorder": 5}
HOME = {**_POINT, "marker": "*", "color": "black", "ms": 6, "label": "home (arrow: start)"}
WAYPOINT = {**_POINT, "marker": "o", "mfc": "none", "mec": "0.5", "ms": 7}
WAYPOINT["label"] = "waypoint (number)"
END = {
    **_POINT,
    "marker": "D",
    "ms": 3.5,
    "mfc": "white",
    "mec": "black",
    "mew": 0.9,
    "label": "end",
}
COLLISION = {**_POINT, "marker": "X", "ms": 7, "mfc": "black", "mec": "white", "mew": 0.6}
COLLISION["label"] = "collision"
TOUCH = {**_POINT, "marker": "s", "ms": 9, "mfc": "none", "mec": PURPLE, "mew": 1.2}
TOUCH["label"] = "bumper closed (number)"


def draw_mission(
    axes: Axes,
    world: World,
    path: pd.DataFrame,
    modes: Sequence[str],
    effects: Mapping[str, str] | None = None,
) -> None:
    """Draw a mission in its world; its context has ``modes`` and ``effects``."""
    draw_obstacles(axes, world).set(array=None, facecolor=OBSTACLE, zorder=1)
    draw_course(axes, world.course)
    axes.set_aspect("equal")
    if path.empty:
        return
    for phase, part in split_by_phase(path):
        _draw_phase(axes, phase, part, modes)
    if has_estimate(path):
        draw_estimate(axes, path)
    draw_arrow(axes, path)
    axes.plot(path["x_m"].iloc[-1], path["y_m"].iloc[-1], **END)
    touched = path["contact"].diff().fillna(path["contact"]) > 0
    axes.plot(path["x_m"][touched], path["y_m"][touched], **COLLISION)
    draw_faults(axes, path, effects or {})
    if TOUCHED in path:
        closed = path[path[TOUCHED].fillna("") != ""]  # empty: another robot has bumpers
        axes.plot(closed["x_m"], closed["y_m"], **TOUCH)
        write_numbers(axes, closed, TOUCHED, (5, -9))


def _draw_phase(axes: Axes, phase: int, path: pd.DataFrame, modes: Sequence[str]) -> None:
    """Draw the way of one phase by mode, with arrows along it."""
    stretches = list(split_by_mode(path))
    for name, (colour, width) in _styles(modes).items():
        driven = [stretch for mode, stretch in stretches if mode == name]
        if driven:
            look = {"colors": colour, "linewidths": width, "linestyles": DASHES[phase]}
            lines = LineCollection(driven, zorder=2.5, label=name, **look)
            axes.add_collection(lines)
    draw_direction(axes, path, phase)


def _styles(modes: Sequence[str]) -> dict[str, tuple[str, float]]:
    """Return colour and width of each mode; the last layer is drawn first."""
    styles = {name: PATHS[i % len(PATHS)] for i, name in enumerate(modes)}
    return dict(reversed([*styles.items(), (NONE, UNDECIDED)]))


def make_handles(
    tracks: pd.DataFrame,
    modes: Sequence[str],
    touched: bool,
    effects: Mapping[str, str] | None = None,
) -> list[Artist]:
    """Make the legend entries of the first robot, and of collisions."""
    driven = set(tracks["mode"])
    handles: list[Artist] = [
        Line2D([], [], color=colour, lw=width, label=name)
        for name, (colour, width) in reversed(_styles(modes).items())
        if name in driven
    ]
    if has_estimate(tracks):
        handles.append(ESTIMATED)
    handles += make_phase_handles(tracks)
    handles += [Line2D([], [], **HOME), Line2D([], [], **END), Line2D([], [], **WAYPOINT)]
    handles.append(Line2D([], [], color="0.5", lw=0.7, ls=":", label="course"))
    handles.append(Patch(fc=OBSTACLE, ec="black", lw=0.3, label="obstacle"))
    if touched:
        handles.append(Line2D([], [], **COLLISION))
    handles += make_fault_handles(tracks, effects or {})
    if TOUCHED in tracks and (tracks[TOUCHED].fillna("") != "").any():
        handles.append(Line2D([], [], **TOUCH))
    return handles
