"""Designs from above, one per panel, with numbered sensors."""

import math
import textwrap
from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ..designs.cones import fit_window, robot_length
from ..tables.showing import ShownDesign
from . import robot
from .robot import assign_markers
from .style import COLUMN_IN, PAGE_IN, assign_colours, use_style

LENGTHS = 1.5  # length at which cones are cut off, in robot lengths
PER_ROW = 3
LABEL_PT = 8.0  # distance of a number from its sensor
LETTERS = 45  # per line of a title


def draw_shown(designs: Sequence[ShownDesign]) -> Figure:
    """Draw each design, in the order given."""
    columns = min(PER_ROW, len(designs))
    rows = math.ceil(len(designs) / columns)
    kinds = dict.fromkeys(kind for design in designs for kind in sorted(set(design.rays.type)))
    colours = assign_colours(list(kinds))
    with use_style():
        width = COLUMN_IN if columns == 1 else PAGE_IN
        views = [fit_window([design.context], design.rays, _cut(design)) for design in designs]
        ratio = max(map(robot.aspect_ratio, views))
        height = rows * (0.9 * ratio * width / columns + 0.7) + 0.3
        figure = Figure(figsize=(width, height), layout="constrained")
        for i, (design, view) in enumerate(zip(designs, views, strict=True), 1):
            axes = figure.add_subplot(rows, columns, i)
            _draw(axes, design, colours)
            robot.frame_axes(axes, view)
        handles = [Patch(fc=colour, alpha=0.5, label=kind) for kind, colour in colours.items()]
        if handles:
            cuts = sorted({round(_cut(design), 2) for design in designs})
            note = f"cones cut off at {', '.join(map(str, cuts))} m"
            figure.legend(
                handles=handles, title=note, loc="outside lower center", ncols=4, frameon=False
            )
    return figure


def _cut(design: ShownDesign) -> float:
    return LENGTHS * robot_length(design.context)


def _draw(axes: Axes, design: ShownDesign, colours: dict[str, str]) -> None:
    rays = design.rays
    chosen = [colours[kind] for kind in rays.type]
    robot.draw_robot(axes, design.context)
    robot.draw_cones(axes, rays, chosen, _cut(design))
    robot.draw_sensors(axes, rays, chosen, assign_markers(rays))
    robot.draw_signals(axes, design.signals, design.context)
    look: dict[str, Any] = {"fontsize": "small", "ha": "center", "va": "center", "zorder": 6}
    poses = design.sensors[["sensor", "x_m", "y_m", "yaw_deg"]].to_numpy(float).tolist()
    for number, x, y, yaw in poses:
        sin, cos = math.sin(math.radians(yaw)), math.cos(math.radians(yaw))
        behind = LABEL_PT * sin, -LABEL_PT * cos  # opposite to the heading
        axes.annotate(f"{number:.0f}", (y, x), behind, textcoords="offset points", **look)
    axes.set(xlabel=robot.AXES[0], ylabel=robot.AXES[1])
    axes.set_title(textwrap.fill(design.title, LETTERS), fontsize="small")
