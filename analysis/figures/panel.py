"""A panel per replicate: the champion's sensors and cones, twins in one colour (Fig. 7)."""

import argparse
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from evoros.storage.figure_context import FigureContext

from ..designs.cones import fit_window, robot_length
from ..drawing import robot
from ..drawing.robot import Champions, draw_signals
from ..drawing.sheet import Sheet
from ..drawing.style import CATEGORIES, COLUMN_IN, figure_width, is_wide, use_style
from ..subcommands import Product
from ..tables.champions import read_champion
from ..tables.study import Study

ONE_ROBOT = True
HELP = "the sensors and cones of each replicate's champion (Figs. 7 and 11)"
NEEDS = "runs with at least one generation"
FILES = ("panel.csv", "panel_signals.csv")
CUT = 0.6  # maximum cone length in robot lengths, which keeps the robot large
PANEL_IN, MIN_PANEL_IN = 1.25, 0.8  # width [in] of a panel, and minimum width on a full page
PAGE_HEIGHT_IN = 9.2
SIDE_IN, FOOT_IN, HEADING_IN, TITLE_IN, LINE_IN = 0.5, 0.5, 0.2, 0.22, 0.17
CERTIFIED_IN = 0.13  # additional title height for an interval
TITLES = "seed: recorded fitness (validated in the run) [validation interval]"


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the panels; the table has one row per sensor."""
    sensors = rank_pairs(study.gather(read_champion))
    contexts = {record.treatment: record.context for record in study.records}
    count = sensors.run.nunique()
    width = figure_width(options.columns, 1 if count <= 4 else 2)
    figure = draw_panels(sensors, contexts, width, study.signals)
    messages = []
    if figure.get_figheight() > PAGE_HEIGHT_IN:
        messages = [f"{count} panels do not fit on one page; name fewer folders"]
    tables = {"panel_signals.csv": study.signals} if len(study.signals) else {}
    return Product(sensors, figure, messages, tables)


def rank_pairs(sensors: pd.DataFrame) -> pd.DataFrame:
    """Add a colour ``rank`` to each pair: 0 for the pair that faces straight ahead most closely."""
    facing = sensors.assign(facing=sensors.yaw_deg.abs().round(9))
    pairs = facing.dropna(subset="pair").sort_values(["run", "facing", "pair"])
    pairs = pairs.drop_duplicates(["run", "pair"])
    pairs = pairs.assign(rank=pairs.groupby("run").cumcount())
    return sensors.merge(pairs[["run", "pair", "rank"]], how="left", on=["run", "pair"])


def draw_panels(
    sensors: pd.DataFrame,
    contexts: Mapping[str, FigureContext],
    width: float = COLUMN_IN,
    signals: pd.DataFrame | None = None,
) -> Figure:
    """Draw a panel per champion, in rows by treatment; ``sensors`` comes from ``rank_pairs``."""
    champions = Champions(sensors, contexts, signals)
    placed = champions.placed
    shown = [contexts[treatment] for treatment in champions.numbers.index]
    cut = float(f"{CUT * max(map(robot_length, shown)):.1g}")
    view = fit_window(shown, placed, cut)
    with use_style():
        handles = [*_make_colour_handles(placed), *champions.make_handles(with_rays=False)]
        columns = 6 if is_wide(width) else 2
        note = _note(placed, cut, width)
        foot = FOOT_IN + LINE_IN * (math.ceil(len(handles) / columns) + 1 + note.count("\n"))
        figure, panels = _make_panels(sensors, robot.aspect_ratio(view), width, foot)
        for run, axes in panels.items():
            cones, first = placed[placed.run == run], sensors[sensors.run == run].iloc[0]
            colours = [CATEGORIES[int(rank) % len(CATEGORIES)] for rank in cones["rank"]]
            robot.draw_robot(axes, contexts[first.treatment])
            robot.draw_cones(axes, cones, colours, cut)
            robot.draw_sensors(axes, cones, colours, champions.markers)
            if len(champions.others):
                others = champions.others[champions.others.run == run]
                draw_signals(axes, others, contexts[first.treatment])
            axes.set_title(_title(first), fontsize="small", pad=2)
            robot.frame_axes(axes, view)
        figure.legend(handles=handles, title=note, loc="lower center", ncols=columns, frameon=False)
    return figure


def _make_colour_handles(placed: pd.DataFrame) -> list[Patch]:
    ranks = [*range(0 if placed.empty else 1 + int(placed["rank"].max()))]
    labels = [", ".join(str(rank + 1) for rank in ranks[i :: len(CATEGORIES)]) for i in ranks]
    labels[:1] = [f"{labels[0]}: closest to forward"] if ranks else []
    return [
        Patch(fc=colour, alpha=0.6, label=label)
        for colour, label in zip(CATEGORIES, labels, strict=False)
    ]


def _title(row: pd.Series) -> str:
    scores = [row.fitness, row.validated_fitness]
    recorded, validated = ("-" if math.isnan(score) else f"{score:z.1f}" for score in scores)
    low, high = row.get("fitness_low", math.nan), row.get("fitness_high", math.nan)
    interval = "" if math.isnan(low) else f"\n[{low:z.1f}, {high:z.1f}]"
    return f"{row.seed}: {recorded} ({validated}){interval}"


def _note(placed: pd.DataFrame, cut: float, width: float) -> str:
    ranges = sorted(placed.range_m.unique())
    lengths = " to ".join(f"{range_m:g}" for range_m in dict.fromkeys([*ranges[:1], *ranges[-1:]]))
    cones = [f"cones of {lengths} m cut off at {cut:g} m"] if ranges and ranges[-1] > cut else []
    return ("; " if is_wide(width) else "\n").join([TITLES, *cones])


def _make_panels(
    sensors: pd.DataFrame, ratio: float, width: float, foot: float
) -> tuple[Figure, dict[str, Axes]]:
    certified = "fitness_low" in sensors and sensors.fitness_low.notna().any()
    above = TITLE_IN + CERTIFIED_IN * certified
    by = sensors.groupby("treatment", sort=False).run
    runs = {str(treatment): list(dict.fromkeys(names)) for treatment, names in by}
    page = lay_out([len(names) for names in runs.values()], ratio, width, foot, above)
    figure = page.make_figure()
    panels: dict[str, Axes] = {}
    places: dict[tuple[int, int], Axes] = {}
    first = 0
    for treatment, names in runs.items():
        for i, run in enumerate(names):
            place = first + i // page.columns, i % page.columns
            panels[run] = places[place] = page.add_panel(figure, *place)
        if len(runs) > 1:
            head: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points"}
            places[first, 0].annotate(treatment, (0, 1), (0, 72 * above), weight="bold", **head)
        first += math.ceil(len(names) / page.columns)
    for (row, column), axes in places.items():
        below = (row + 1, column) in places
        axes.set_ylabel("" if column else robot.AXES[1], fontsize="small")
        axes.set_xlabel("" if below else robot.AXES[0], fontsize="small")
        axes.tick_params(labelleft=not column, labelbottom=not below)
    return figure, panels


def lay_out(
    numbers: Sequence[int], ratio: float, width: float, foot: float, above: float = TITLE_IN
) -> Sheet:
    """Lay out panels (``ratio`` = height / width), on one page if possible; heights in inches."""
    heading = HEADING_IN * (len(numbers) > 1)
    pages = []
    for panel_in in (PANEL_IN, MIN_PANEL_IN):
        columns = max(1, int((width - SIDE_IN) / panel_in))
        columns = math.ceil(max(numbers) / math.ceil(max(numbers) / columns))  # equal rows
        rows = [math.ceil(panels / columns) for panels in numbers]
        heads = [above + heading * (row == 0) for count in rows for row in range(count)]
        pages.append(Sheet(width, columns, [ratio] * len(heads), heads, bottom=foot))
    fitting = (page for page in pages if page.height <= PAGE_HEIGHT_IN)
    return next(fitting, _shrink(pages[-1]))


def _shrink(page: Sheet) -> Sheet:
    room = PAGE_HEIGHT_IN - sum(page.heads) - page.bottom - 1e-6  # margin for rounding
    panel = min(max(room / sum(page.ratios), MIN_PANEL_IN), page.panel)
    spare = page.columns * (page.panel - panel)
    if page.columns == 1:
        return replace(page, right=page.right + spare)
    return replace(page, gap=page.gap + spare / max(page.columns - 1, 1))
