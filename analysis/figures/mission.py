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
from evoros.base.errors import InputError
from evoros.base.log import LOGGER
from evoros.world.model import World

from ..drawing.style import BLUE, GREEN, PAGE_IN, PURPLE, STYLE, VERMILLION, YELLOW
from ..drawing.style import width as width_of
from ..drawing.worlds import draw_course, draw_obstacles
from ..product import Product
from ..tables.records import Record
from ..tables.study import Study
from ..tables.tracks import NONE, champions_world, track

HELP = "the champion's missions from above: path by mode, collisions, where sensors failed"
OBSTACLE = "0.8"
PATHS = ((VERMILLION, 1.6), (BLUE, 0.8), (GREEN, 1.2), (PURPLE, 1.6))
"""Colour and width [pt] of each mode, in the controller's order: told apart without colour, too."""
UNDECIDED = ("0.3", 0.8)
ENDINGS = {
    "completed": "completed in {:.0f} s",
    "collision": "collision at {:.0f} s",
    "time_limit": "time limit, {:.0f} s",
}
_TOGETHER_M = 1.2  # failures nearer to each other than this share a label
_ARROW_M = 1.5  # length of the arrow along the first of the path
_PANEL_IN = 1.7  # the least width of a panel
_WORDS_IN = 0.75  # what title and labels add to its height
_POINT: dict[str, Any] = {"ls": "none", "zorder": 5}
HOME = {**_POINT, "marker": "*", "color": "black", "ms": 6, "label": "home (arrow: start)"}
WAYPOINT = {**_POINT, "marker": "o", "mfc": "none", "mec": "0.5", "ms": 7, "label": "waypoint"}
COLLISION = {**_POINT, "marker": "X", "ms": 7, "mfc": "black", "mec": "white", "mew": 0.6}
COLLISION["label"] = "collision"
FAILURE = {**_POINT, "marker": "v", "ms": 5, "mfc": YELLOW, "mec": "black", "mew": 0.7}
FAILURE["label"] = "sensor failed (number)"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Which run and which worlds."""
    parser.add_argument("--run", metavar="NAME", help="instead of the best run")
    parser.add_argument(
        "--world", metavar="NAME", action="append", help="only this world; may be repeated"
    )


def product(study: Study, options: argparse.Namespace) -> Product:
    """Of the run that was asked for, else of the best."""
    study.check_worlds(options.world or [])
    record, (tracks, worlds) = study.chosen(options.run, partial(_whole, wanted=options.world))
    table = pd.concat(tracks, ignore_index=True)
    width = width_of(options.columns, 1 if len(worlds) == 1 else 2)
    said = [_said(record, len(study.records))] if len(study.records) > 1 else []
    return Product(table, mission(table, worlds, record.setting.modes, width), said)


def mission(
    tracks: pd.DataFrame,
    worlds: Mapping[str, World],
    modes: Sequence[str],
    width: float = PAGE_IN,
) -> Figure:
    """A panel a world; ``tracks`` has the columns of ``tracks.COLUMNS``, ``width`` is in inches.

    ``modes`` are the names in the column ``mode``, in the order of the controller's layers.
    """
    columns = min(len(worlds), max(1, int(width / _PANEL_IN)))
    rows = math.ceil(len(worlds) / columns)
    with mpl.rc_context(STYLE):
        figure = Figure(layout="constrained")
        grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        panels, free = list(grid.flat)[: len(worlds)], list(grid.flat)[len(worlds) :]
        for axes, (name, world) in zip(panels, worlds.items(), strict=True):
            path = tracks[tracks["world"] == name].reset_index(drop=True)
            _draw(axes, world, path, modes)
            axes.set_title(f"{name}\n{_ending(path)}")
            axes.set_xlabel("x [m]")
            axes.tick_params(labelbottom=True)
        for row in grid:
            row[0].set_ylabel("y [m]")
        wide, high = (
            abs(end - begin) for begin, end in (panels[0].get_xlim(), panels[0].get_ylim())
        )
        panel = (width - 0.5) / columns * high / wide + _WORDS_IN
        figure.set_size_inches(width, rows * panel + (0.0 if free else 0.4))
        _legend(figure, free, _handles(tracks, modes))
    return figure


def stretches(path: pd.DataFrame) -> Iterator[tuple[str, Array]]:
    """The path of one mission in pieces (n, 2) [m] of one mode each, one after another.

    From a record to the next the robot does what was decided at the first of the two.
    """
    places, modes = path[["x_m", "y_m"]].to_numpy(float), path["mode"].to_numpy()[:-1]
    begins = [i for i in range(len(modes)) if i == 0 or modes[i] != modes[i - 1]]
    for begin, end in zip(begins, [*begins[1:], len(modes)], strict=True):
        yield str(modes[begin]), places[begin : end + 1]


def _whole(
    record: Record, wanted: Sequence[str] | None
) -> tuple[list[pd.DataFrame], dict[str, World]]:
    """The tracks and worlds that can be read; what cannot is said and left out."""
    tracks, worlds = [], {}
    for name in record.setting.courses:
        if wanted and name not in wanted:
            continue
        try:
            path = track(record.run, record.setting, name)
            worlds[name] = champions_world(record.run, record.setting, name)
        except InputError as error:
            LOGGER.warning("%s; %s is left out", error, name)
            continue
        except (LookupError, ValueError, TypeError, AttributeError) as error:
            said = " ".join(str(error).split())
            LOGGER.warning("%s: must be whole (%s); %s is left out", record.path, said, name)
            continue
        tracks.append(path)
    if not worlds:
        raise InputError(f"{record.path}: must have a whole mission to show, and has none")
    return tracks, worlds


def _said(record: Record, runs: int) -> str:
    status = record.run.status
    validated = status.get("best_validated_fitness")
    rest = "" if validated is None else f", {validated:.3f} validated"
    return f"{record.name}: one of {runs} runs, fitness {status['best_fitness']:.3f} recorded{rest}"


def _ending(path: pd.DataFrame) -> str:
    """How the mission ended, from its last record."""
    if path.empty:
        return "not flown"
    last = path.iloc[-1]
    return ENDINGS.get(last["ended"], str(last["ended"]).replace("_", " ")).format(last["time_s"])


def _draw(axes: Axes, world: World, path: pd.DataFrame, modes: Sequence[str]) -> None:
    draw_obstacles(axes, world).set(array=None, facecolor=OBSTACLE, zorder=1)
    draw_course(axes, world.course)
    axes.set_aspect("equal")
    if path.empty:
        return
    pieces = list(stretches(path))
    for name, (color, thick) in _styles(modes).items():
        own = [piece for mode, piece in pieces if mode == name]
        if own:
            lines = LineCollection(own, colors=color, linewidths=thick, zorder=2.5, label=name)
            axes.add_collection(lines)
    _arrow(axes, path)
    touched = path["contact"].diff().fillna(path["contact"]) > 0
    axes.plot(path["x_m"][touched], path["y_m"][touched], **COLLISION)
    failed = path[path["failed_sensors"] != ""]
    axes.plot(failed["x_m"], failed["y_m"], **FAILURE)
    for (x, y), text in _labels(failed):
        axes.annotate(text, (x, y), xytext=(3, 3), textcoords="offset points", fontsize=7, zorder=6)


def _styles(modes: Sequence[str]) -> dict[str, tuple[str, float]]:
    """Colour and width of each mode, the last decision-maker drawn first."""
    each = {name: PATHS[i % len(PATHS)] for i, name in enumerate(modes)}
    return dict(reversed([*each.items(), (NONE, UNDECIDED)]))


def _arrow(axes: Axes, path: pd.DataFrame) -> None:
    """Which way the robot left home."""
    places = path[["x_m", "y_m"]].to_numpy(float)
    away = np.hypot(*(places - places[0]).T)
    end = places[int(np.argmax(away >= _ARROW_M))] if away.max() >= _ARROW_M else places[-1]
    shape = {"arrowstyle": "-|>", "mutation_scale": 6, "lw": 0.8, "color": "black"}
    axes.annotate("", end, places[0], arrowprops={**shape, "shrinkA": 0, "shrinkB": 0}, zorder=4)


def _labels(failed: pd.DataFrame) -> Iterator[tuple[tuple[float, float], str]]:
    """The numbers of sensors that failed, one label for those that failed near each other."""
    groups: list[tuple[tuple[float, float], list[str]]] = []
    places = zip(failed["x_m"].tolist(), failed["y_m"].tolist(), strict=True)
    for place, text in zip(places, failed["failed_sensors"].tolist(), strict=True):
        numbers = text.split(";")
        if groups and math.dist(groups[-1][0], place) < _TOGETHER_M:
            groups[-1][1].extend(numbers)
        else:
            groups.append((place, numbers))
    for place, numbers in groups:
        yield place, ", ".join(numbers)


def _handles(tracks: pd.DataFrame, modes: Sequence[str]) -> list[Line2D]:
    """What is drawn, and no more."""
    driven = set(tracks["mode"])
    handles = [
        Line2D([], [], color=color, lw=thick, label=name)
        for name, (color, thick) in reversed(_styles(modes).items())
        if name in driven
    ]
    handles += [Line2D([], [], **HOME), Line2D([], [], **WAYPOINT)]
    if (tracks["contact"] > 0).any():
        handles.append(Line2D([], [], **COLLISION))
    if (tracks["failed_sensors"] != "").any():
        handles.append(Line2D([], [], **FAILURE))
    return handles


def _legend(figure: Figure, free: Sequence[Axes], handles: Sequence[Line2D]) -> None:
    """In a panel that is left over, else below all."""
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
