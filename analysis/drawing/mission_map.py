"""One mission on the map: its path by mode, collisions, failures, and its legend."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

from evoros.world.model import World

from ..tables.tracks import NONE, TOUCHED
from .drift import ESTIMATED, draw_estimate, has_estimate
from .faults import draw_faults, make_fault_handles
from .paths import draw_arrow, split_by_mode, write_numbers
from .style import BLUE, GREEN, PURPLE, VERMILLION
from .worlds import draw_course, draw_obstacles

OBSTACLE = "0.8"
PATHS = ((VERMILLION, 1.6), (BLUE, 0.8), (GREEN, 1.2), (PURPLE, 1.6))
"""Colour and width [pt] of each mode, in the order of the controller's layers."""
UNDECIDED = ("0.3", 0.8)
_POINT: dict[str, Any] = {"ls": "none", "zorder": 5}
HOME = {**_POINT, "marker": "*", "color": "black", "ms": 6, "label": "home (arrow: start)"}
WAYPOINT = {**_POINT, "marker": "o", "mfc": "none", "mec": "0.5", "ms": 7, "label": "waypoint"}
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
    """Draw a mission in its world; ``modes`` are in the order of the controller's layers.

    ``effects`` tell what faults do to readings, as ``FailureContext.effects``.
    """
    draw_obstacles(axes, world).set(array=None, facecolor=OBSTACLE, zorder=1)
    draw_course(axes, world.course)
    axes.set_aspect("equal")
    if path.empty:
        return
    stretches = list(split_by_mode(path))
    for name, (colour, width) in _styles(modes).items():
        own = [stretch for mode, stretch in stretches if mode == name]
        if own:
            lines = LineCollection(own, colors=colour, linewidths=width, zorder=2.5, label=name)
            axes.add_collection(lines)
    if has_estimate(path):
        draw_estimate(axes, path)
    draw_arrow(axes, path)
    touched = path["contact"].diff().fillna(path["contact"]) > 0
    axes.plot(path["x_m"][touched], path["y_m"][touched], **COLLISION)
    draw_faults(axes, path, effects or {})
    if TOUCHED in path:
        closed = path[path[TOUCHED].fillna("") != ""]  # empty: another robot has bumpers
        axes.plot(closed["x_m"], closed["y_m"], **TOUCH)
        write_numbers(axes, closed, TOUCHED, (5, -9))


def _styles(modes: Sequence[str]) -> dict[str, tuple[str, float]]:
    """Return colour and width of each mode; the last layer is drawn first."""
    styles = {name: PATHS[i % len(PATHS)] for i, name in enumerate(modes)}
    return dict(reversed([*styles.items(), (NONE, UNDECIDED)]))


def make_handles(
    tracks: pd.DataFrame,
    modes: Sequence[str],
    touched: bool,
    effects: Mapping[str, str] | None = None,
) -> list[Line2D]:
    """Make the legend entries of what is drawn of the first robot, and of collisions."""
    driven = set(tracks["mode"])
    handles = [
        Line2D([], [], color=colour, lw=width, label=name)
        for name, (colour, width) in reversed(_styles(modes).items())
        if name in driven
    ]
    if has_estimate(tracks):
        handles.append(ESTIMATED)
    handles += [Line2D([], [], **HOME), Line2D([], [], **WAYPOINT)]
    if touched:
        handles.append(Line2D([], [], **COLLISION))
    handles += make_fault_handles(tracks, effects or {})
    if TOUCHED in tracks and (tracks[TOUCHED].fillna("") != "").any():
        handles.append(Line2D([], [], **TOUCH))
    return handles
