"""How far the estimated pose of a robot is from the true one, on the way and on the map."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure
from matplotlib.lines import Line2D

from evoros.base.arrays import Array

from .style import BLACK, BLUE, VERMILLION

ESTIMATED = Line2D([], [], color=BLACK, lw=0.9, ls=(0, (3, 1.5)), label="estimated path")


def has_estimate(tracks: pd.DataFrame) -> bool:
    """Whether missions have an estimated pose."""
    return "estimated_x_m" in tracks


def draw_estimate(axes: Axes, path: pd.DataFrame) -> None:
    """Draw the path that the robot took for its own."""
    places = path["estimated_x_m"], path["estimated_y_m"]
    axes.plot(*places, color=BLACK, lw=0.9, ls=(0, (3, 1.5)), zorder=3)


def draw_errors(figure: SubFigure, paths: Mapping[str, pd.DataFrame], columns: int) -> None:
    """Draw a panel for each mission: the errors of position and heading over the way."""
    rows = -(-len(paths) // columns)
    grid = figure.subplots(rows, columns, squeeze=False, sharey=True)
    panels: Sequence[Axes] = list(grid.flat)
    twins = []
    for axes, path in zip(panels, paths.values(), strict=False):
        way, place, heading = measure_drift(path)
        if not len(way):  # not run
            way, place, heading = np.zeros((3, 1))
        axes.plot(way, place, color=BLUE, lw=1.0)
        axes.set(xlabel="distance driven [m]", xlim=(0.0, max(float(way[-1]), 1e-3)))
        twin = axes.twinx()
        twin.plot(way, heading, color=VERMILLION, lw=0.9, ls="-.")
        twin.spines["right"].set_visible(True)
        twins.append(twin)
    panels[0].set_ylim(0.0, max(axes.get_ylim()[1] for axes in panels[: len(paths)]))
    high = max(twin.get_ylim()[1] for twin in twins)
    for index, twin in enumerate(twins):
        last = index % columns == columns - 1 or index == len(twins) - 1
        twin.set(ylim=(0.0, high), ylabel="heading error [deg]" if last else "")
        twin.tick_params(labelright=last, colors=VERMILLION, which="both")
        twin.yaxis.label.set_color(VERMILLION)
    for axes in panels[len(paths) :]:
        axes.set_axis_off()
    for row in grid:
        row[0].set_ylabel("position error [m]", color=BLUE)
        row[0].tick_params(axis="y", colors=BLUE)


def measure_drift(path: pd.DataFrame) -> tuple[Array, Array, Array]:
    """Return the way [m] and the errors of position [m] and heading [deg], each (n,).

    The last record has the estimate of the last decision before, and is left out.
    """
    rows = path.iloc[:-1] if len(path) > 1 else path
    x, y = rows["x_m"].to_numpy(float), rows["y_m"].to_numpy(float)
    steps = np.hypot(np.diff(x, prepend=x[:1]), np.diff(y, prepend=y[:1]))
    aside = rows["estimated_x_m"].to_numpy(float) - x, rows["estimated_y_m"].to_numpy(float) - y
    turn = rows["estimated_yaw_rad"].to_numpy(float) - rows["yaw_rad"].to_numpy(float)
    heading = np.abs(np.degrees(np.arctan2(np.sin(turn), np.cos(turn))))
    return np.cumsum(steps), np.hypot(*aside), heading
