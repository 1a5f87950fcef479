"""Small designs inside the cells of a map: the robot, its sensors and their cones, nose up."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from evoros.base.arrays import Array
from evoros.storage.figure_context import FigureContext

from ..designs.cones import Window, fit_window, outline_part, robot_length, trace_cones
from .robot import to_page
from .style import VERMILLION

MIN_IN = 0.19  # side of a cell in which a design can be told from others
LENGTHS = 0.7  # of the robot, at which cones are cut
_SHARE = 0.9  # of the side of a cell that a design takes
_BODY, _WHEEL, _EDGE = "0.97", "0.35", "black"


def draw_in_cells(
    axes: Axes, centres: Array, side: Array, designs: Sequence[pd.DataFrame], context: FigureContext
) -> None:
    """Draw each design into its cell.

    ``centres`` (n, 2) and ``side`` (2,) of the cells are in the units of the axes. ``designs`` have
    ``designs.COLUMNS``; all are drawn to the same scale.
    """
    reach = LENGTHS * robot_length(context)
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
    """Transform points (n, 2) of the robot's frame to shares of a cell's side from its centre."""
    x_low, x_high, y_low, y_high = view
    scale = _SHARE / max(x_high - x_low, y_high - y_low)
    across, up = to_page(points - np.array([(x_low + x_high) / 2, 0.0])).T
    return scale * np.column_stack([-across, up])
