"""Small pictures of a few designs, beside what they are chosen from."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from evoros.base.arrays import Array
from evoros.storage.figure_context import FigureContext

from ..designs.cones import fit_window, robot_length
from . import robot
from .style import BLUE

LENGTHS = 1.5  # of the robot, at which cones are cut


def choose_apart(points: Array, count: int) -> list[int]:
    """Choose rows of ``points`` (n, 2), the first one and then always the one farthest from all."""
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
    """Draw a design with its cones into each panel; ``designs`` have ``designs.COLUMNS``."""
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
