"""The course in each world: waypoints, home, and the route of the first phase (Fig. 6)."""

import argparse
import math
from collections.abc import Mapping
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from evoros.analysis.drawing.mission_map import HOME, OBSTACLE, WAYPOINT
from evoros.analysis.drawing.sheet import fit_height
from evoros.analysis.drawing.style import BLUE, PAGE_IN, figure_width, is_wide, use_style
from evoros.analysis.drawing.worlds import draw_course, draw_obstacles
from evoros.analysis.subcommands import Product, add_worlds
from evoros.analysis.tables.champions import load_shown_world
from evoros.analysis.tables.records import Record
from evoros.analysis.tables.study import Study
from evoros.base.errors import InputError
from evoros.world.course import Course
from evoros.world.model import World

FIRST_ROBOT = True
HELP = "the course of each world: waypoints, home, path of the first phase (Fig. 6)"
NEEDS = "a run, finished or with record=all"
FILES = ("course.csv",)
add_arguments = add_worlds
_PANEL_IN = 1.7  # minimum width [in] of a panel
_ARROW = {"arrowstyle": "-|>", "mutation_scale": 8, "lw": 1.0, "color": BLUE, "shrinkB": 0.0}


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the worlds of the best run, with a table of waypoints."""
    study.check_worlds(options.world or [])
    _, worlds = study.choose(None, partial(_read, wanted=options.world), True)
    width = figure_width(options.columns, 1 if len(worlds) == 1 else 2)
    return Product(list_waypoints(worlds), draw_courses(worlds, width))


def _read(record: Record, wanted: list[str] | None) -> dict[str, World]:
    names = [name for name in record.context.courses if not wanted or name in wanted]
    if not names:
        raise InputError(f"{record.path}: has none of the chosen worlds; choose other worlds")
    return {name: load_shown_world(record, name) for name in names}


def list_waypoints(worlds: Mapping[str, World]) -> pd.DataFrame:
    """List the waypoints of each world (home is number 0) with their acceptance radius."""
    rows = [
        (name, index, float(x), float(y), world.course.acceptance_m)
        for name, world in worlds.items()
        for index, (x, y) in enumerate([world.course.home[:2], *world.course.waypoints])
    ]
    return pd.DataFrame(rows, columns=["world", "number", "x_m", "y_m", "acceptance_m"])


def draw_courses(worlds: Mapping[str, World], width: float = PAGE_IN) -> Figure:
    """Draw a panel per world; ``width`` is in inches."""
    columns = min(len(worlds), max(1, int(width / _PANEL_IN)))
    rows = math.ceil(len(worlds) / columns)
    with use_style():
        figure = Figure((width, width), layout="constrained")
        grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        panels = list(grid.flat)
        for axes, (name, world) in zip(panels, worlds.items(), strict=False):
            solids = draw_obstacles(axes, world)
            solids.set(array=None, facecolor=OBSTACLE, zorder=1)
            draw_course(axes, world.course)
            _draw_first_phase(axes, world.course)
            axes.set(title=name, xlabel="x [m]", aspect="equal")
            axes.tick_params(labelbottom=True)
        for axes in panels[len(worlds) :]:
            axes.remove()
        for row in grid:
            row[0].set_ylabel("y [m]")
        drawn = (solid for axes in panels[: len(worlds)] for solid in axes.collections)
        one_way = all(world.course.is_one_way for world in worlds.values())
        _add_legend(figure, any(len(solid.get_paths()) for solid in drawn), one_way)
        fit_height(figure, panels[: len(worlds)], rows)
    return figure


def _draw_first_phase(axes: Axes, course: Course) -> None:
    legs = [*pairwise(course.first_phase)]
    ways = {(*begin, *end) for begin, end in legs}
    for begin, end in legs:
        if (*end, *begin) in ways:  # driven both ways: draw one line per direction, to its right
            x, y = (end - begin) / np.hypot(*(end - begin))
            aside = 0.25 * course.acceptance_m * np.array([y, -x])
            begin, end = begin + aside, end + aside
        middle = begin + 0.6 * (end - begin)  # keeps the arrowhead clear of all markers
        axes.plot(*np.array([begin, end]).T, color=BLUE, lw=1.0, zorder=2)
        axes.annotate("", middle, begin, arrowprops={**_ARROW, "shrinkA": 0.0}, zorder=2)


def _add_legend(figure: Figure, with_obstacles: bool, one_way: bool) -> None:
    first: dict[str, Any] = {"color": BLUE, "lw": 1.0, "marker": ">", "ms": 4}
    entries: list[Line2D | Patch] = [
        Line2D([], [], label="course" if one_way else "first phase (second: reversed)", **first),
        Line2D([], [], **{**HOME, "label": "home"}),
        Line2D([], [], **{**WAYPOINT, "label": "waypoint and radius"}),
    ]
    if with_obstacles:
        entries.append(Patch(fc=OBSTACLE, ec="black", lw=0.3, label="obstacle"))
    across = 4 if is_wide(figure.get_figwidth()) else 2
    figure.legend(handles=entries, loc="outside lower center", ncols=across, frameon=False)
