"""The champion's missions from above: obstacles, course, path by mode, failures (Fig. 6)."""

import argparse
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from evoros.base.arrays import Array
from evoros.base.errors import InputError, single_line
from evoros.base.log import LOGGER
from evoros.world.model import World

from ..drawing.style import (
    BLUE,
    GREEN,
    PAGE_IN,
    PURPLE,
    STYLE,
    VERMILLION,
    YELLOW,
    figure_width,
)
from ..drawing.worlds import draw_course, draw_obstacles
from ..product import Product
from ..tables.records import Record
from ..tables.study import Study
from ..tables.tracks import NONE, load_champion_world, read_track

HELP = "the champion's missions from above: path by mode, collisions, where sensors failed"
OBSTACLE = "0.8"
PATHS = ((VERMILLION, 1.6), (BLUE, 0.8), (GREEN, 1.2), (PURPLE, 1.6))
"""Colour and width [pt] of each mode, in the order of the controller's layers."""
UNDECIDED = ("0.3", 0.8)
ENDINGS = {
    "completed": "completed in {:.0f} s",
    "collision": "collision at {:.0f} s",
    "time_limit": "time limit, {:.0f} s",
}
_LABEL_M = 1.2  # failures within this distance share a label
_ARROW_M = 1.5  # length of the arrow along the beginning of the path
_PANEL_IN = 1.7  # minimum width of a panel
_WORDS_IN = 0.75  # height of a panel's title and labels
_POINT: dict[str, Any] = {"ls": "none", "zorder": 5}
HOME = {**_POINT, "marker": "*", "color": "black", "ms": 6, "label": "home (arrow: start)"}
WAYPOINT = {**_POINT, "marker": "o", "mfc": "none", "mec": "0.5", "ms": 7, "label": "waypoint"}
COLLISION = {**_POINT, "marker": "X", "ms": 7, "mfc": "black", "mec": "white", "mew": 0.6}
COLLISION["label"] = "collision"
FAILURE = {**_POINT, "marker": "v", "ms": 5, "mfc": YELLOW, "mec": "black", "mew": 0.7}
FAILURE["label"] = "sensor failed (number)"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the choices of the run and the worlds."""
    parser.add_argument("--run", metavar="NAME", help="instead of the best run")
    parser.add_argument(
        "--world", metavar="NAME", action="append", help="only this world; may be repeated"
    )


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the missions of the named run's champion, or of the best run's."""
    study.check_worlds(options.world or [])
    record, (tracks, worlds) = study.choose(options.run, partial(_read, wanted=options.world))
    table = pd.concat(tracks, ignore_index=True)
    width = figure_width(options.columns, 1 if len(worlds) == 1 else 2)
    messages = [_report(record, len(study.records))] if len(study.records) > 1 else []
    return Product(table, draw_missions(table, worlds, record.context.modes, width), messages)


def draw_missions(
    tracks: pd.DataFrame,
    worlds: Mapping[str, World],
    modes: Sequence[str],
    width: float = PAGE_IN,
) -> Figure:
    """Draw a panel for each world.

    ``tracks`` has the columns of ``tracks.COLUMNS``. ``modes`` are the names in its column
    ``mode``, in the order of the controller's layers. ``width`` is in inches.
    """
    columns = min(len(worlds), max(1, int(width / _PANEL_IN)))
    rows = math.ceil(len(worlds) / columns)
    with mpl.rc_context(STYLE):
        figure = Figure(layout="constrained")
        grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        panels, free = list(grid.flat)[: len(worlds)], list(grid.flat)[len(worlds) :]
        for axes, (name, world) in zip(panels, worlds.items(), strict=True):
            path = tracks[tracks["world"] == name].reset_index(drop=True)
            _draw_mission(axes, world, path, modes)
            axes.set_title(f"{name}\n{_ending(path)}")
            axes.set_xlabel("x [m]")
            axes.tick_params(labelbottom=True)
        for row in grid:
            row[0].set_ylabel("y [m]")
        x_span, y_span = (
            abs(end - begin) for begin, end in (panels[0].get_xlim(), panels[0].get_ylim())
        )
        panel = (width - 0.5) / columns * y_span / x_span + _WORDS_IN
        figure.set_size_inches(width, rows * panel + (0.0 if free else 0.4))
        _add_legend(figure, free, _make_handles(tracks, modes))
    return figure


def split_by_mode(path: pd.DataFrame) -> Iterator[tuple[str, Array]]:
    """Split the path of one mission into consecutive stretches (n, 2) [m] of one mode each.

    From a record to the next the robot does what was decided at the first of the two.
    """
    places, modes = path[["x_m", "y_m"]].to_numpy(float), path["mode"].to_numpy()[:-1]
    begins = [i for i in range(len(modes)) if i == 0 or modes[i] != modes[i - 1]]
    for begin, end in zip(begins, [*begins[1:], len(modes)], strict=True):
        yield str(modes[begin]), places[begin : end + 1]


def _read(
    record: Record, wanted: Sequence[str] | None
) -> tuple[list[pd.DataFrame], dict[str, World]]:
    """Read tracks and worlds; report and skip those that cannot be read."""
    record.run.require_trajectories()
    tracks, worlds = [], {}
    for name in record.context.courses:
        if wanted and name not in wanted:
            continue
        try:
            path = read_track(record.run, record.context, name)
            worlds[name] = load_champion_world(record.run, record.context, name)
        except InputError as error:
            LOGGER.warning("%s; %s is left out", error, name)
            continue
        except (LookupError, ValueError, TypeError, AttributeError) as error:
            reason = single_line(error)
            LOGGER.warning("%s: must be complete (%s); %s is left out", record.path, reason, name)
            continue
        tracks.append(path)
    if not worlds:
        raise InputError(
            f"{record.path}: must have a complete mission of its champion, but has none; restore it"
        )
    return tracks, worlds


def _report(record: Record, runs: int) -> str:
    status = record.run.status
    validated = status.get("best_validated_fitness")
    rest = "" if validated is None else f", {validated:.3f} validated"
    return f"{record.name}: one of {runs} runs, fitness {status['best_fitness']:.3f} recorded{rest}"


def _ending(path: pd.DataFrame) -> str:
    """Describe how the mission ended, from its last record."""
    if path.empty:
        return "not run"
    last = path.iloc[-1]
    return ENDINGS.get(last["ended"], str(last["ended"]).replace("_", " ")).format(last["time_s"])


def _draw_mission(axes: Axes, world: World, path: pd.DataFrame, modes: Sequence[str]) -> None:
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
    _draw_arrow(axes, path)
    touched = path["contact"].diff().fillna(path["contact"]) > 0
    axes.plot(path["x_m"][touched], path["y_m"][touched], **COLLISION)
    failed = path[path["failed_sensors"] != ""]
    axes.plot(failed["x_m"], failed["y_m"], **FAILURE)
    for (x, y), text in _labels(failed):
        axes.annotate(text, (x, y), xytext=(3, 3), textcoords="offset points", fontsize=7, zorder=6)


def _styles(modes: Sequence[str]) -> dict[str, tuple[str, float]]:
    """Return colour and width of each mode; the last layer is drawn first."""
    styles = {name: PATHS[i % len(PATHS)] for i, name in enumerate(modes)}
    return dict(reversed([*styles.items(), (NONE, UNDECIDED)]))


def _draw_arrow(axes: Axes, path: pd.DataFrame) -> None:
    """Draw an arrow from home in the direction of the path."""
    places = path[["x_m", "y_m"]].to_numpy(float)
    distances = np.hypot(*(places - places[0]).T)
    far = distances >= _ARROW_M
    end = places[int(np.argmax(far))] if far.any() else places[-1]
    shape = {"arrowstyle": "-|>", "mutation_scale": 6, "lw": 0.8, "color": "black"}
    axes.annotate("", end, places[0], arrowprops={**shape, "shrinkA": 0, "shrinkB": 0}, zorder=4)


def _labels(failed: pd.DataFrame) -> Iterator[tuple[tuple[float, float], str]]:
    """Yield the numbers of failed sensors, one label for failures near each other."""
    groups: list[tuple[tuple[float, float], list[str]]] = []
    places = zip(failed["x_m"].tolist(), failed["y_m"].tolist(), strict=True)
    for place, text in zip(places, failed["failed_sensors"].tolist(), strict=True):
        numbers = text.split(";")
        if groups and math.dist(groups[-1][0], place) < _LABEL_M:
            groups[-1][1].extend(numbers)
        else:
            groups.append((place, numbers))
    for place, numbers in groups:
        yield place, ", ".join(numbers)


def _make_handles(tracks: pd.DataFrame, modes: Sequence[str]) -> list[Line2D]:
    """Make the legend entries of what is drawn."""
    driven = set(tracks["mode"])
    handles = [
        Line2D([], [], color=colour, lw=width, label=name)
        for name, (colour, width) in reversed(_styles(modes).items())
        if name in driven
    ]
    handles += [Line2D([], [], **HOME), Line2D([], [], **WAYPOINT)]
    if (tracks["contact"] > 0).any():
        handles.append(Line2D([], [], **COLLISION))
    if (tracks["failed_sensors"] != "").any():
        handles.append(Line2D([], [], **FAILURE))
    return handles


def _add_legend(figure: Figure, free: Sequence[Axes], handles: Sequence[Line2D]) -> None:
    """Add the legend in a panel that is left over, else below the panels."""
    for axes in free:
        axes.set_axis_off()
    if free:
        free[0].legend(handles=handles, loc="center", frameon=False, handlelength=1.6)
        return
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=6 if figure.get_figwidth() > 5 else 3,
        frameon=False,
        handlelength=1.6,
        columnspacing=1.0,
    )
