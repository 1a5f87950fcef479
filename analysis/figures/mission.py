"""The champion's missions from above: obstacles, course, path by mode, failures (Fig. 6)."""

import argparse
import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure

from evoros.base.errors import InputError, single_line
from evoros.base.log import LOGGER
from evoros.storage.figure_context import FigureContext
from evoros.world.model import World

from ..drawing.companions import draw_companions, make_companion_handles
from ..drawing.drift import draw_errors, has_estimate
from ..drawing.mission_map import draw_mission, make_handles
from ..drawing.readings import draw_readings, measure_height
from ..drawing.style import PAGE_IN, figure_width, scale_type, use_style
from ..drawing.words import wrap_all
from ..product import Product
from ..tables.certified import describe_rates
from ..tables.records import Record
from ..tables.robots import name_robots
from ..tables.study import Study
from ..tables.traces import Trace, read_traces
from ..tables.tracks import load_champion_world, read_tracks, select_track

HELP = "the champion's missions from above: path by mode, collisions, where sensors failed"
ENDINGS = {
    "completed": "completed in {:.0f} s",
    "collision": "collision at {:.0f} s",
    "time_limit": "time limit, {:.0f} s",
}
_PANEL_IN = 1.7  # minimum width of a panel
_ERRORS_IN = 1.3  # height of a panel of errors
_WORDS_IN, _LINE_IN = 0.45, 0.15  # height of a panel's labels, and of a line of its title
_PER_IN, _SMALL_PER_IN = 13.5, 16.5  # letters of a title, and of a legend
_HARD_SPACE = "\N{NO-BREAK SPACE}"
_HANDLE = 6  # letters in whose place an entry of the legend has its mark


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the choices of the run and the worlds."""
    parser.add_argument("--run", metavar="NAME", help="instead of the best run")
    parser.add_argument(
        "--world", metavar="NAME", action="append", help="only this world; may be repeated"
    )
    parser.add_argument(
        "--readings", action="store_true", help="also what sensors that see nothing read over time"
    )


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the missions of the named run's champion, or of the best run's."""
    study.check_worlds(options.world or [])
    record, (tracks, worlds) = study.choose(options.run, partial(_read, wanted=options.world))
    table = pd.concat(tracks, ignore_index=True)
    width = figure_width(options.columns, 1 if len(worlds) == 1 else 2)
    messages = [_report(record, len(study.records))] if len(study.records) > 1 else []
    context = record.context
    robots = {"": context, **context.agents}
    shown = worlds if getattr(options, "readings", False) else ()
    traces = {name: read_traces(record, name) for name in shown}
    figure = draw_missions(
        table, worlds, context.modes, width, robots, traces, describe_rates(record)
    )
    return Product(table, figure, messages)


def draw_missions(
    tracks: pd.DataFrame,
    worlds: Mapping[str, World],
    modes: Sequence[str],
    width: float = PAGE_IN,
    robots: Mapping[str, FigureContext] | None = None,
    traces: Mapping[str, Sequence[Trace]] | None = None,
    rates: Mapping[str, str] | None = None,
) -> Figure:
    """Draw a panel for each world.

    ``tracks`` has the columns of ``tracks.COLUMNS``. ``modes`` are the names in its column
    ``mode``, in the order of the controller's layers. ``width`` is in inches. If the missions have
    an estimated pose, a panel below each one has its errors. ``robots`` has the contexts of several
    robots by name, which is that in the column ``agent``; the first one's is empty. ``traces`` are
    readings of each world, which are drawn below. ``rates`` say how often each was completed.
    """
    rates = rates or {}
    robots, everyone = robots or {}, tracks
    effects = robots[""].failure.effects if "" in robots else {}
    tracks = everyone[name_robots(everyone) == ""]
    paths = {name: select_track(tracks, name) for name in worlds}
    columns = min(len(worlds), max(1, int(width / _PANEL_IN)))
    room = _PER_IN / scale_type(1.0) * width / columns
    rows = math.ceil(len(worlds) / columns)
    with use_style():
        figure = Figure(layout="constrained")
        below = _list_parts_below(tracks, paths, traces or {}, columns)
        stack = figure.add_gridspec(1 + len(below), 1) if below else None
        upper = figure if stack is None else figure.add_subfigure(stack[0])
        grid = upper.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        panels, free = list(grid.flat)[: len(worlds)], list(grid.flat)[len(worlds) :]
        for axes, (name, world) in zip(panels, worlds.items(), strict=True):
            draw_mission(axes, world, paths[name], modes, effects)
            others = {agent: select_track(everyone, name, agent) for agent in robots if agent}
            draw_companions(axes, paths[name], others, robots)
            title = _title(name, paths[name], others, rates.get(name))
            axes.set(title=wrap_all(title, room), xlabel="x [m]")
            axes.tick_params(labelbottom=True)
        for row in grid:
            row[0].set_ylabel("y [m]")
        panel = _measure_panel(panels, (width - 0.5) / columns)
        touched = bool((everyone["contact"] > 0).any())
        handles = make_handles(tracks, modes, touched, effects)
        handles += make_companion_handles([*robots][1:])
        if free and max(len(str(each.get_label())) for each in handles) > room:
            for axes in free:
                axes.remove()
            free = []
        across = _count_columns(handles, width)
        legend_lines = -(-len(handles) // across)
        height = rows * panel + (0.0 if free else scale_type(0.15 + _LINE_IN * legend_lines))
        if stack is not None:
            stack.set_height_ratios((height, *(tall for _, tall in below)))
            for place, (draw_part, tall) in enumerate(below, 1):
                draw_part(figure.add_subfigure(stack[place]))
                height += tall
        figure.set_size_inches(width, height)
        _add_legend(upper, free, handles, across)
    return figure


def _list_parts_below(
    tracks: pd.DataFrame,
    paths: Mapping[str, pd.DataFrame],
    traces: Mapping[str, Sequence[Trace]],
    columns: int,
) -> list[tuple[Callable[[SubFigure], None], float]]:
    """List what is drawn below the maps, with its height [in]."""
    parts: list[tuple[Callable[[SubFigure], None], float]] = []
    if has_estimate(tracks):
        height = math.ceil(len(paths) / columns) * _ERRORS_IN
        parts.append((partial(draw_errors, paths=paths, columns=columns), height))
    if any(traces.values()):
        draw = partial(draw_readings, traces=traces, columns=columns)
        parts.append((draw, measure_height(traces, columns)))
    return parts


def _measure_panel(panels: Sequence[Axes], width: float) -> float:
    """Return the height [in] of a panel of this width, with its words."""
    limits = (panels[0].get_xlim(), panels[0].get_ylim())
    x_span, y_span = (abs(end - begin) for begin, end in limits)
    lines = max(len(axes.get_title().splitlines()) for axes in panels)
    return width * y_span / x_span + scale_type(_WORDS_IN + _LINE_IN * lines)


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
            path = read_tracks(record.run, record.context, name)
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
    if status.get("fitness_low") is not None:
        rest += f" [{status['fitness_low']:.3f}, {status['fitness_high']:.3f}]"
    return f"{record.name}: one of {runs} runs, fitness {status['best_fitness']:.3f} recorded{rest}"


def _title(
    name: str, path: pd.DataFrame, others: Mapping[str, pd.DataFrame], rate: str | None
) -> list[str]:
    """Return the lines above a panel: the world, how each robot's mission ended, and ``rate``."""
    endings = [_ending(path), *(f"{n}: {_ending(other)}" for n, other in others.items())]
    whole = re.sub(r"\[.*\]", lambda match: match[0].replace(" ", _HARD_SPACE), rate or "")
    return [*filter(None, (name, *endings, whole))]


def _count_columns(handles: Sequence[Artist], width: float) -> int:
    """Return how many columns of the legend fit into a width [in]."""
    lengths = [len(str(each.get_label())) + _HANDLE for each in handles]
    for count in range(min(6, len(lengths)), 1, -1):
        deep = -(-len(lengths) // count)
        columns = [lengths[i : i + deep] for i in range(0, len(lengths), deep)]
        if sum(map(max, columns)) <= width * _SMALL_PER_IN / scale_type(1.0):
            return count
    return 1


def _ending(path: pd.DataFrame) -> str:
    """Describe how the mission ended, from its last record."""
    if path.empty:
        return "not run"
    last = path.iloc[-1]
    return ENDINGS.get(last["ended"], str(last["ended"]).replace("_", " ")).format(last["time_s"])


def _add_legend(
    figure: Figure | SubFigure, free: Sequence[Axes], handles: Sequence[Artist], across: int
) -> None:
    """Add the legend in a panel that is left over, else below the panels."""
    for axes in free:
        axes.set_axis_off()
    if free:
        free[0].legend(handles=handles, loc="center", frameon=False, handlelength=1.6)
        return
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=across,
        frameon=False,
        handlelength=1.6,
        columnspacing=1.0,
    )
