"""A panel a replicate: its champion's sensors and cones, twins in one colour (Figs. 7 and 11)."""

import argparse
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import matplotlib as mpl
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from evoros.storage.figure_context import FigureContext

from ..drawing.robot import (
    AXES,
    aspect,
    draw_cones,
    draw_robot,
    draw_sensors,
    frame,
    length,
    markers_of,
    type_handles,
    window,
)
from ..drawing.sheet import Sheet
from ..drawing.style import CATEGORIES, COLUMN_IN, PAGE_IN, STYLE
from ..drawing.style import width as width_of
from ..product import Product
from ..tables.designs import champion_or_none
from ..tables.study import Study

HELP = "a panel a replicate with its champion's sensors and cones (Figs. 7 and 11)"
CUT = 0.6  # of the robot's length: longer cones leave no room to the robot
PANEL_IN, LEAST_IN = 1.25, 0.8  # width of a panel, and where the page would be too short for it
PAGE_HIGH_IN = 9.2
SIDE_IN, FOOT_IN, HEADING_IN, TITLE_IN, LINE_IN = 0.5, 0.5, 0.2, 0.2, 0.17
TITLES = "seed: recorded fitness (validated in the run)"


def product(study: Study, options: argparse.Namespace) -> Product:
    """The command's; the table has a row a sensor."""
    sensors = ranked(study.gather(champion_or_none))
    settings = {record.treatment: record.setting for record in study.records}
    number = sensors.run.nunique()
    figure = panel(sensors, settings, width_of(options.columns, 1 if number <= 4 else 2))
    said = []
    if figure.get_figheight() > PAGE_HIGH_IN:
        said = [f"{number} panels need more than one page: give fewer folders"]
    return Product(sensors, figure, said)


def ranked(sensors: pd.DataFrame) -> pd.DataFrame:
    """Sensors with the column ``rank``, which the colour stands for, so that panels compare.

    0 is that of the champion's pair which faces nearest to straight ahead; twins share it.
    """
    facing = sensors.assign(facing=sensors.yaw_deg.abs().round(9))
    pairs = facing.dropna(subset="pair").sort_values(["run", "facing", "pair"])
    pairs = pairs.drop_duplicates(["run", "pair"])
    pairs = pairs.assign(rank=pairs.groupby("run").cumcount())
    return sensors.merge(pairs[["run", "pair", "rank"]], how="left", on=["run", "pair"])


def panel(
    sensors: pd.DataFrame, settings: Mapping[str, FigureContext], width: float = COLUMN_IN
) -> Figure:
    """A panel a champion, rows by treatment; ``width`` is in inches.

    ``sensors`` is what ``ranked`` gives, a row without a place being a champion that has none;
    ``settings`` has the setting of each treatment.
    """
    placed = sensors.dropna(subset="x_m")
    treatments = list(dict.fromkeys(sensors.treatment))
    shown = [settings[treatment] for treatment in treatments]
    cut = float(f"{CUT * max(map(length, shown)):.1g}")
    view = window(shown, placed, cut)
    markers = markers_of(placed)
    with mpl.rc_context(STYLE):
        handles = [*_colour_handles(placed), *type_handles(markers)]
        across = 3 if width < PAGE_IN else 6
        note = _note(placed, cut, width)
        foot = FOOT_IN + LINE_IN * (math.ceil(len(handles) / across) + 1 + note.count("\n"))
        figure, panels = _panels(sensors, treatments, aspect(view), width, foot)
        for run, axes in panels.items():
            own = placed[placed.run == run]
            colours = [CATEGORIES[int(rank) % len(CATEGORIES)] for rank in own["rank"]]
            treatment = sensors.loc[sensors.run == run, "treatment"].iloc[0]
            draw_robot(axes, settings[treatment])
            draw_cones(axes, own, colours, cut)
            draw_sensors(axes, own, colours, markers)
            axes.set_title(_title(sensors[sensors.run == run].iloc[0]), fontsize=6.5, pad=2)
            frame(axes, view)
        figure.legend(
            handles=handles,
            title=note,
            loc="lower center",
            ncols=across,
            frameon=False,
        )
    return figure


def _colour_handles(placed: pd.DataFrame) -> list[Patch]:
    """For each rank its colour, said of the first and last."""
    ranks = sorted(placed["rank"].astype(int).unique())[: len(CATEGORIES)]
    said = {len(ranks) - 1: "faces most aside", 0: "faces most ahead"}
    return [
        Patch(fc=CATEGORIES[rank % len(CATEGORIES)], alpha=0.6, label=said.get(rank, "in between"))
        for rank in ranks
    ]


def _title(row: pd.Series) -> str:
    scores = [row.fitness, row.validated_fitness]
    recorded, validated = ("-" if math.isnan(score) else f"{score:.1f}" for score in scores)
    return f"{row.seed}: {recorded} ({validated})"


def _note(placed: pd.DataFrame, cut: float, width: float) -> str:
    farthest = placed.range_m.max()
    cones = [f"cones of {farthest:g} m cut at {cut:g} m"] if farthest > cut else []
    return ("; " if width >= PAGE_IN else "\n").join([TITLES, *cones])


def _panels(
    sensors: pd.DataFrame, treatments: Sequence[str], ratio: float, width: float, foot: float
) -> tuple[Figure, dict[str, Axes]]:
    """Axes by run, each treatment beginning in a new row."""
    runs = [list(dict.fromkeys(sensors[sensors.treatment == t].run)) for t in treatments]
    page = sheet([len(each) for each in runs], ratio, width, foot)
    figure = page.figure()
    panels: dict[str, Axes] = {}
    places: dict[tuple[int, int], Axes] = {}
    first = 0
    for treatment, each in zip(treatments, runs, strict=True):
        for i, run in enumerate(each):
            place = first + i // page.columns, i % page.columns
            panels[run] = places[place] = page.axes(figure, *place)
        if len(treatments) > 1:
            _head(places[first, 0], treatment)
        first += math.ceil(len(each) / page.columns)
    for (row, column), axes in places.items():
        below = (row + 1, column) in places
        axes.set_ylabel("" if column else AXES[1], fontsize=7)
        axes.set_xlabel("" if below else AXES[0], fontsize=7)
        axes.tick_params(labelleft=not column, labelbottom=not below)
    return figure, panels


def _head(axes: Axes, treatment: str) -> None:
    """The name of a treatment, above the title of its first panel."""
    offset = (0, 72 * TITLE_IN)
    axes.annotate(
        treatment,
        (0, 1),
        offset,
        xycoords="axes fraction",
        textcoords="offset points",
        weight="bold",
    )


def sheet(numbers: Sequence[int], ratio: float, width: float, foot: float) -> Sheet:
    """Where the panels are: of a good size, or smaller where they then fit on one page.

    ``numbers`` are the panels of each treatment, ``ratio`` is a panel's height over its width,
    ``foot`` the room for the legend [in].
    """
    most, several, pages = max(numbers), HEADING_IN * (len(numbers) > 1), []
    for least in (PANEL_IN, LEAST_IN):
        columns = max(1, int((width - SIDE_IN) / least))
        even = math.ceil(most / math.ceil(most / columns))
        rows = [math.ceil(number / even) for number in numbers]
        heads = [TITLE_IN + several * (row == 0) for count in rows for row in range(count)]
        pages.append(Sheet(width, even, [ratio] * len(heads), heads, bottom=foot))
    return next((page for page in pages if page.height <= PAGE_HIGH_IN), _shrunk(pages[-1]))


def _shrunk(page: Sheet) -> Sheet:
    """The same panels farther apart and smaller, for one page if they need not be too small."""
    room = PAGE_HIGH_IN - sum(page.heads) - page.bottom
    panel = min(max(room / sum(page.ratios), LEAST_IN), page.panel)
    spare = page.columns * (page.panel - panel)
    return replace(page, gap=page.gap + spare / max(page.columns - 1, 1))
