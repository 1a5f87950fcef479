"""Small pictures of designs, next to a plot of the designs or in the cells of an archive."""

import math
import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from evoros.base.arrays import Array
from evoros.storage.figure_context import FigureContext

from ..designs.cones import Window, fit_window, outline_part, robot_length, trace_cones
from ..tables.showing import ShownDesign
from . import robot
from .robot import to_page
from .style import BLUE, COLUMN_IN, PAGE_IN, VERMILLION, assign_colours, use_style

PER_ROW, LETTERS = 3, 45  # design panels per row, and characters per line of their titles
POSE = ["sensor", "x_m", "y_m", "yaw_deg"]
LABEL_PT = 8.0  # distance [pt] of a sensor's number from the sensor
LENGTHS = 1.5  # maximum cone length in panels, in robot lengths
_QUARTILES = (0.25, 0.5, 0.75)
MIN_IN = 0.19  # minimum side [in] of a cell in which a design is recognizable
SHORT = 0.7  # cone length in cells, in robot lengths
_SHARE = 0.9  # size of a design as a fraction of its cell's side
_BODY, _WHEEL, _EDGE = "0.97", "0.35", "black"


def choose_apart(points: Array, count: int) -> list[int]:
    """Choose rows of ``points`` (n, 2): the first, then always the farthest from those chosen."""
    scale = np.ptp(points, axis=0)
    scaled = points / np.where(scale > 0, scale, 1.0)
    chosen = [0]
    while len(chosen) < min(count, len(points)):
        gaps = np.min([np.sum((scaled - scaled[i]) ** 2, axis=1) for i in chosen], axis=0)
        if gaps.max() == 0:
            break
        chosen.append(int(gaps.argmax()))
    return chosen


def draw_designs(
    panels: Sequence[Axes],
    titles: Sequence[str],
    designs: Sequence[pd.DataFrame],
    context: FigureContext,
) -> None:
    """Draw one design per panel, with its cones."""
    reach = LENGTHS * robot_length(context)
    everything = pd.concat(list(designs))
    view = fit_window([context], everything, reach)
    markers = robot.assign_markers(everything)
    for axes, title, sensors in zip(panels, titles, designs, strict=True):
        robot.draw_robot(axes, context)
        colours = [BLUE] * len(sensors)
        robot.draw_cones(axes, sensors, colours, reach)
        robot.draw_sensors(axes, sensors, colours, markers, (2.2, 1.0))
        robot.frame_axes(axes, view)
        axes.set_title(title, pad=2, fontsize="small")
        axes.axis("off")


def draw_shown(designs: Sequence[ShownDesign]) -> Figure:
    """Draw each design in a separate panel, with numbered sensors."""
    columns = min(PER_ROW, len(designs))
    size = (COLUMN_IN if columns == 1 else PAGE_IN), 2.6 * math.ceil(len(designs) / columns)
    look: dict[str, Any] = {"fontsize": "small", "ha": "center", "va": "center", "zorder": 6}
    with use_style():
        figure = Figure(figsize=size, layout="constrained")
        for i, design in enumerate(designs, 1):
            axes = figure.add_subplot(math.ceil(len(designs) / columns), columns, i)
            title = textwrap.fill(design.title, LETTERS)
            draw_designs([axes], [title], [design.rays], design.context)
            robot.draw_signals(axes, design.signals, design.context)
            axes.set(xlabel=robot.AXES[0], ylabel=robot.AXES[1])
            axes.axis("on")
            for number, x, y, yaw in design.sensors[POSE].to_numpy(float).tolist():
                back = math.radians(yaw + 180.0)
                place = -LABEL_PT * math.sin(back), LABEL_PT * math.cos(back)
                axes.annotate(f"{number:.0f}", (y, x), place, textcoords="offset points", **look)
    return figure


def draw_in_cells(
    axes: Axes, centres: Array, side: Array, designs: Sequence[pd.DataFrame], context: FigureContext
) -> None:
    """Draw designs to the same scale in cells with ``centres`` (n, 2) and size ``side`` (2,)."""
    reach = SHORT * robot_length(context)
    view = fit_window([context], pd.concat(list(designs)), reach, margin_m=0.0)
    parts = sorted(context.parts, key=lambda part: part.top_m)
    shapes: list[Array] = []
    colours: list[str] = []
    for sensors, centre in zip(designs, centres, strict=True):
        cones = trace_cones(sensors, reach)
        for outlines, of in (
            (cones, [VERMILLION] * len(cones)),
            ([outline_part(p) for p in parts], [_WHEEL if p.wheel else _BODY for p in parts]),
        ):
            shapes += [centre + side * _to_cell(outline, view) for outline in outlines]
            colours += of
        places = sensors[["x_m", "y_m"]].to_numpy(dtype=np.float64)
        dots = centre + side * _to_cell(places, view)
        axes.scatter(dots[:, 0], dots[:, 1], s=1.6, c=_EDGE, linewidths=0, zorder=4)
    drawn = PolyCollection(
        shapes, facecolors=colours, edgecolors=_EDGE, linewidths=0.25, zorder=3.0
    )
    axes.add_collection(drawn, autolim=False)


def _to_cell(points: Array, view: Window) -> Array:
    """Convert points (n, 2) on the robot to offsets from a cell's centre, in units of its side."""
    x_low, x_high, y_low, y_high = view
    scale = _SHARE / max(x_high - x_low, y_high - y_low)
    across, up = to_page(points - np.array([(x_low + x_high) / 2, 0.0])).T
    return scale * np.column_stack([-across, up])


def draw_growth(
    axes: Axes, growth: pd.DataFrame, treatments: Sequence[str], pooled: bool, column: str
) -> None:
    """Plot a column over missions: each run, or the median and quartiles of each treatment."""
    for treatment, colour in assign_colours(treatments).items():
        rows = growth[growth.treatment == treatment]
        if not pooled:
            for name in dict.fromkeys(rows.run):
                run = rows[rows.run == name]
                axes.plot(run.missions, run[column], color=colour, lw=0.9, marker=".", ms=3)
            continue
        by_generation = rows.groupby("generation")
        missions = by_generation.missions.median()
        low, middle, high = (by_generation[column].quantile(share) for share in _QUARTILES)
        axes.fill_between(missions, low, high, color=colour, alpha=0.2, lw=0)
        axes.plot(missions, middle, color=colour, lw=1.2, marker=".", ms=3)
    axes.set_xlabel("missions per run")
    axes.set_ylim(bottom=0)
    axes.set_xlim(left=0)
