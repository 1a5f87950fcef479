"""Walkers on the map of a mission: their ways, and where they were nearest to the robot."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from evoros.base.arrays import Array

from ..tables.walkers import WalkerTrack
from .style import SKY, VERMILLION
from .worlds import HALO

_WAY: dict[str, Any] = {"color": SKY, "lw": 0.5, "ls": (0, (1, 1.5)), "alpha": 0.6}
_TIME: dict[str, Any] = {"fontsize": "x-small", "zorder": 4.7, "textcoords": "offset points"}
_TIME["xytext"] = (3, 2)
_MARK: dict[str, Any] = {"ls": "none", "marker": "o", "mec": "black", "mew": 0.4, "ms": 6}


def draw_walkers(axes: Axes, walkers: Sequence[WalkerTrack], path: pd.DataFrame) -> None:
    """Draw each walker, with the time [s], where it touched the robot or was nearest to it."""
    if path.empty:
        return
    times, places = path["time_s"].to_numpy(float), path[["x_m", "y_m"]].to_numpy(float)
    for walker in walkers:
        shown = walker.time_s <= times[-1] + 1e-6
        axes.plot(*walker.places[shown].T, zorder=1.5, **_WAY)
        touch = walker.find_touch(0)
        if touch is not None and not shown[touch]:
            touch = None
        row = _find_nearest(walker.places[shown], places) if touch is None else touch
        x, y = walker.places[row].tolist()
        colour = SKY if touch is None else VERMILLION
        circle = Circle((x, y), walker.radius_m, fc=colour, ec="black", lw=0.4, zorder=4.6)
        axes.add_patch(circle)
        axes.annotate(f"{walker.time_s[row]:.0f}", (x, y), path_effects=[HALO], **_TIME)


def _find_nearest(walker: Array, robot: Array) -> int:
    """Return the record at which two ways (n, 2) [m] are nearest to each other."""
    count = min(len(walker), len(robot))
    apart = walker[:count] - robot[:count]
    return int(np.nanargmin((apart * apart).sum(axis=1)))


def make_walker_handles(walkers: Sequence[WalkerTrack]) -> list[Artist]:
    """Make the legend entries of the walkers."""
    if not walkers:
        return []
    handles: list[Artist] = [
        Line2D([], [], label="way of a walker", **_WAY),
        Line2D([], [], mfc=SKY, label="walker, nearest (time)", **_MARK),
    ]
    if any(walker.find_touch(0) is not None for walker in walkers):
        handles.append(Line2D([], [], mfc=VERMILLION, label="walker, touched (time)", **_MARK))
    return handles
