"""Top view of the champion's missions: obstacles, course, path by mode, failures (Fig. 6)."""

import argparse
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D

from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext
from evoros.terminal.log import LOGGER
from evoros.world.model import World

from ..drawing import mission_map
from ..drawing.sheet import fit_height
from ..drawing.style import CATEGORIES, PAGE_IN, figure_width, scale_type, use_style, wrap_all
from ..subcommands import Product, add_run, add_worlds
from ..tables.agents import read_tracks
from ..tables.champions import load_shown_world, require_trajectories
from ..tables.readings import Trace, WalkerTrack, read_traces, read_walkers, to_table
from ..tables.records import Record
from ..tables.study import Study, read_complete
from ..tables.tracks import name_robots, select_track
from ..tables.validated import describe_rates

WORST_MISSION = True
HELP = "maps of the champion's missions: path by mode, collisions, sensor failures"
NEEDS = "stored trajectories from a finished run, a run with record=all, or an evaluation"
FILES = ("mission.csv", "mission_walkers.csv")
ENDINGS = {
    "completed": "completed in {:.0f} s",
    "collision": "collision at {:.0f} s",
    "time_limit": "time limit, {:.0f} s",
}
_PANEL_IN = 1.7  # minimum width [in] of a panel
_ERRORS_IN = 1.3  # height [in] of an error panel
_PER_IN, _SMALL_PER_IN = 13.5, 16.5  # characters per inch of titles, and of legends
_HARD_SPACE = "\N{NO-BREAK SPACE}"
_HANDLE = 6  # width of a legend marker in characters
UNITS = {
    "mps": "speed\n[m/s]",
    "radps": "rate\n[rad/s]",
    "mps2": "acceleration\n[m/s²]",
    "": "closed",  # unit of bumpers
}
PANEL_IN, LEGEND_IN = 0.85, 0.6  # heights [in] of a readings panel and of the legend
_STYLES = ("-", "--", "-.", ":")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--run``, ``--world`` and ``--readings``."""
    add_run(parser)
    add_worlds(parser)
    about = "also plot the readings of sensors without rays"
    parser.add_argument("--readings", action="store_true", help=about)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the missions of the named run's champion (default: the best run's)."""
    study.check_worlds(options.world or [])
    record, (tracks, worlds) = study.choose(options.run, partial(_read, wanted=options.world), True)
    walkers = {name: read_walkers(record, name) for name in worlds}
    width = figure_width(options.columns, 1 if len(worlds) == 1 else 2)
    context, shown = record.context, worlds if getattr(options, "readings", False) else ()
    missions = Missions(
        pd.concat(tracks, ignore_index=True),
        worlds,
        context.modes,
        {"": context, **context.agents},
        {name: read_traces(record, name) for name in shown},
        describe_rates(record),
        walkers,
    )
    messages = [_report(record, len(study.records))] if len(study.records) > 1 else []
    tables = {"mission_walkers.csv": to_table(walkers)} if any(walkers.values()) else {}
    return Product(missions.tracks, draw_missions(missions, width), messages, tables=tables)


@dataclass(frozen=True, eq=False)
class Missions:
    """The missions of a champion, one per world."""

    tracks: pd.DataFrame  # tracks of all robots, with columns ``tracks.COLUMNS``
    worlds: Mapping[str, World]
    modes: Sequence[str]  # one mode per controller layer
    # Context of each robot, by name in the column ``agent``, which is empty for the main robot.
    robots: Mapping[str, FigureContext] = field(default_factory=dict)
    traces: Mapping[str, Sequence[Trace]] = field(default_factory=dict)  # readings by world
    rates: Mapping[str, str] = field(default_factory=dict)  # completion rate in each world
    walkers: Mapping[str, Sequence[WalkerTrack]] = field(default_factory=dict)  # tracks by world

    @property
    def effects(self) -> Mapping[str, str]:
        """The effect on readings of each kind of fault, by name."""
        return self.robots[""].failure.effects if self.robots else {}

    @cached_property
    def first(self) -> pd.DataFrame:
        """The tracks of the main robot."""
        return self.tracks[name_robots(self.tracks) == ""]

    @cached_property
    def paths(self) -> dict[str, pd.DataFrame]:
        """The path of the main robot in each world."""
        return {name: select_track(self.first, name) for name in self.worlds}

    def list_handles(self) -> list[Artist]:
        """List the entries of the legend."""
        touched = bool((self.tracks["contact"] > 0).any())
        handles = mission_map.make_handles(self.first, self.modes, touched, self.effects)
        walkers = [walker for tracks in self.walkers.values() for walker in tracks]
        others = mission_map.make_companion_handles([*self.robots][1:])
        return [*handles, *others, *mission_map.make_walker_handles(walkers)]


def draw_missions(missions: Missions, width: float = PAGE_IN) -> Figure:
    """Draw a panel per world, with errors and readings below; ``width`` is in inches."""
    columns = min(len(missions.worlds), max(1, int(width / _PANEL_IN)))
    room = _PER_IN / scale_type(1.0) * width / columns
    rows = math.ceil(len(missions.worlds) / columns)
    with use_style():
        figure = Figure((width, width), layout="constrained")
        below = _list_parts_below(missions, columns)
        stack = figure.add_gridspec(1 + len(below), 1) if below else None
        upper = figure if stack is None else figure.add_subfigure(stack[0])
        grid = upper.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        count = len(missions.worlds)
        panels, free = list(grid.flat)[:count], list(grid.flat)[count:]
        for axes, name in zip(panels, missions.worlds, strict=True):
            _draw_map(axes, missions, name, room)
        for row in grid:
            row[0].set_ylabel("y [m]")
        handles = missions.list_handles()
        if free and max(len(str(handle.get_label())) for handle in handles) > room:
            for axes in free:
                axes.remove()
            free = []
        across = _count_columns(handles, width)
        _add_legend(upper, free, handles, across)
        for place, (draw_part, _) in enumerate(below, 1):
            draw_part(figure.add_subfigure(stack[place]))  # type: ignore[index]
        fit_height(figure, panels, rows, stack, [tall for _, tall in below])
    return figure


def _draw_map(axes: Axes, missions: Missions, name: str, room: float) -> None:
    """Draw the missions of all robots in a world; title lines have at most ``room`` characters."""
    path, robots = missions.paths[name], missions.robots
    mission_map.draw_mission(axes, missions.worlds[name], path, missions.modes, missions.effects)
    mission_map.draw_walkers(axes, missions.walkers.get(name, ()), path)
    others = {agent: select_track(missions.tracks, name, agent) for agent in robots if agent}
    mission_map.draw_companions(axes, path, others, robots)
    endings = [_ending(path), *(f"{agent}: {_ending(other)}" for agent, other in others.items())]
    rate = missions.rates.get(name, "")
    whole = re.sub(r"\[.*\]", lambda match: match[0].replace(" ", _HARD_SPACE), rate)
    title = wrap_all(filter(None, (name, *endings, whole)), room)
    axes.set(title=title, xlabel="x [m]")
    axes.tick_params(labelbottom=True)


def _list_parts_below(
    missions: Missions, columns: int
) -> list[tuple[Callable[[SubFigure], None], float]]:
    parts: list[tuple[Callable[[SubFigure], None], float]] = []
    if mission_map.has_estimate(missions.first):
        height = math.ceil(len(missions.paths) / columns) * _ERRORS_IN
        parts.append(
            (partial(mission_map.draw_errors, paths=missions.paths, columns=columns), height)
        )
    if any(missions.traces.values()):
        draw = partial(_draw_readings, traces=missions.traces, columns=columns)
        rows = math.ceil(len(missions.traces) / columns)
        parts.append((draw, rows * len(_list_units(missions.traces)) * PANEL_IN + LEGEND_IN))
    return parts


def _read(
    record: Record, wanted: Sequence[str] | None
) -> tuple[list[pd.DataFrame], dict[str, World]]:
    require_trajectories(record)
    tracks, worlds = [], {}
    for name in record.context.courses:
        if not wanted or name in wanted:
            try:
                path, worlds[name] = read_complete(record, partial(_read_mission, name=name))
                tracks.append(path)
            except InputError as error:
                LOGGER.warning("%s; %s is left out", error, name)
    if not worlds:
        raise InputError(
            f"{record.path}: no complete mission of the champion was found; restore the folder"
        )
    return tracks, worlds


def _read_mission(record: Record, name: str) -> tuple[pd.DataFrame, World]:
    return read_tracks(record, name), load_shown_world(record, name)


def _report(record: Record, runs: int) -> str:
    status = record.run.status
    validated = status.get("best_validated_fitness")
    rest = "" if validated is None else f", {validated:.3f} validated"
    if status.get("fitness_low") is not None:
        rest += f" [{status['fitness_low']:.3f}, {status['fitness_high']:.3f}]"
    return f"{record.name}: one of {runs} runs, fitness {status['best_fitness']:.3f} recorded{rest}"


def _count_columns(handles: Sequence[Artist], width: float) -> int:
    lengths = [len(str(handle.get_label())) + _HANDLE for handle in handles]
    for count in range(min(6, len(lengths)), 1, -1):
        if sum(map(max, np.array_split(lengths, count))) <= width * _SMALL_PER_IN / scale_type(1.0):
            return count
    return 1


def _ending(path: pd.DataFrame) -> str:
    if path.empty:
        return "not run"
    last = path.iloc[-1]
    return ENDINGS.get(last["ended"], str(last["ended"]).replace("_", " ")).format(last["time_s"])


def _add_legend(
    figure: Figure | SubFigure, free: Sequence[Axes], handles: Sequence[Artist], across: int
) -> None:
    for axes in free:
        axes.set_axis_off()
    style: dict[str, Any] = {"handles": handles, "frameon": False, "handlelength": 1.6}
    if free:
        free[0].legend(loc="center", **style)
    else:
        figure.legend(loc="outside lower center", ncols=across, columnspacing=1.0, **style)


def _draw_readings(figure: SubFigure, traces: Mapping[str, Sequence[Trace]], columns: int) -> None:
    units = _list_units(traces)
    rows = -(-len(traces) // columns)
    grid = figure.subplots(rows * len(units), columns, squeeze=False, sharey="row")
    labels = list(dict.fromkeys(trace.label for recorded in traces.values() for trace in recorded))
    styles = {label: _choose_style(place) for place, label in enumerate(labels)}
    for place, recorded in enumerate(traces.values()):
        row, column = divmod(place, columns)
        for step, unit in enumerate(units):
            axes: Axes = grid[row * len(units) + step, column]
            shown = [trace for trace in recorded if trace.unit == unit]
            for order, trace in enumerate(shown):
                _draw_trace(axes, trace, order, styles[trace.label])
            if unit == "":
                axes.set_yticks([order + 0.4 for order in range(len(shown))])
                axes.set_yticklabels([trace.label.split()[0] for trace in shown])
            axes.tick_params(labelbottom=step == len(units) - 1)
            axes.set_ylabel("" if column else UNITS.get(unit, f"[{unit}]"))
            if step == len(units) - 1:
                axes.set_xlabel("time [s]")
    for axes in grid[-len(units) :, (len(traces) - 1) % columns + 1 :].flat:
        axes.set_axis_off()
    handles = [Line2D([], [], label=f"sensor {label}", **style) for label, style in styles.items()]
    across = 5 if columns > 2 else 2
    figure.legend(handles=handles, loc="outside lower center", ncols=across, frameon=False)


def _list_units(traces: Mapping[str, Sequence[Trace]]) -> list[str]:
    return list(dict.fromkeys(trace.unit for recorded in traces.values() for trace in recorded))


def _choose_style(place: int) -> dict[str, Any]:
    colour = CATEGORIES[place % len(CATEGORIES)]
    return {"color": colour, "ls": _STYLES[place // len(CATEGORIES) % len(_STYLES)]}


def _draw_trace(axes: Axes, trace: Trace, order: int, style: Mapping[str, Any]) -> None:
    if trace.unit == "":
        values = order + 0.8 * trace.values
        axes.fill_between(trace.time_s, order, values, step="post", color=style["color"], lw=0.7)
    else:
        axes.plot(trace.time_s, trace.values, lw=1.0 / (1 + order), **style)
    if np.isfinite(trace.failed_s):
        mark: dict[str, Any] = {"marker": "^", "ms": 5, "mec": "black", "mew": 0.5, "zorder": 5}
        below = axes.get_xaxis_transform()
        axes.plot(trace.failed_s, 0.0, color=style["color"], transform=below, clip_on=False, **mark)
