"""Many champions on one robot: where their sensors are and what they see (the paper's Fig. 8).

Half a metre of a cone shows how cones and places lie on a robot of half a metre, its whole range of
4.5 m which directions are covered: both are drawn. Overlapping translucent cones would tell no
number, so the shade of a place is a count: of the champions of which a sensor covers it. Of single
champions the sensors are counted, which shows where cones of one robot overlap.
"""

import argparse
import math
from collections.abc import Mapping, Sequence
from itertools import product as product_of

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext

from ..drawing.robot import (
    AXES,
    Window,
    aspect,
    draw_robot,
    draw_sensors,
    frame,
    length,
    markers_of,
    type_handles,
    window,
)
from ..drawing.sheet import Sheet
from ..drawing.style import COLUMN_IN, STYLE
from ..drawing.style import width as width_of
from ..measures.raster import cells, coverage, raster
from ..product import Product
from ..tables.designs import champion_or_none
from ..tables.study import Study
from ..tables.treatments import ALONE

HELP = "sensors and cones of the champions on one robot, darker where they coincide (Fig. 8)"
Shades = tuple[ListedColormap, BoundaryNorm]
PER_ROW_IN = 1.7  # a panel narrower than this tells nothing
BAR_IN = 0.75  # room for the colour bar
HEADS_IN = (0.38, 0.6)  # room above the first view and above the others
SEEN = "whose cones cover a place"


def arguments(parser: argparse.ArgumentParser) -> None:
    """The option of this subcommand."""
    parser.add_argument(
        "--cut",
        type=float,
        metavar="M",
        help="length of the cones in the nearer view [m]; about that of the robot",
    )


def product(study: Study, options: argparse.Namespace) -> Product:
    """The command's: the counts as table, the sensors as one more."""
    sensors = study.gather(champion_or_none)
    settings = {
        record.treatment: record.setting
        for record in study.records
        if record.treatment in set(sensors.treatment)
    }
    cover = coverage(sensors, settings, cuts(sensors, settings, options.cut))
    wide = width_of(options.columns, 1 if len(settings) == 1 else 2)
    figure = overlay(cover, sensors, settings, wide)
    places = sensors.to_csv(index=False, lineterminator="\n").encode()
    return Product(cover, figure, files={"overlay_sensors.csv": places})


def cuts(
    sensors: pd.DataFrame, settings: Mapping[str, FigureContext], near_m: float | None = None
) -> tuple[float, ...]:
    """Where cones are cut, in the nearer view and in that of the whole range [m].

    Only at the whole range where that is no farther; nowhere where there are no sensors.

    Raises:
        InputError: ``near_m`` is no length.
    """
    if near_m is not None and not 0 < near_m < math.inf:
        raise InputError(f"--cut: must be a length greater than 0, not {near_m}; for example 0.5")
    if sensors.x_m.isna().all():
        return ()
    far = float(sensors.range_m.max())
    near = near_m or max(round(max(map(length, settings.values())), 1), 0.1)
    return (near, far) if near < far else (far,)


def overlay(
    cover: pd.DataFrame,
    sensors: pd.DataFrame,
    settings: Mapping[str, FigureContext],
    width: float = COLUMN_IN,
) -> Figure:
    """A panel a treatment and cut: the robot, its champions' sensors, and what they cover.

    ``cover`` is what ``coverage`` gives; a row of ``sensors`` without a place is a champion that
    has none; ``width`` is in inches.
    """
    placed = sensors.dropna(subset="x_m")
    cuts_m = sorted(cover.cut_m.unique()) or [0.0]
    views = [window(settings.values(), placed, cut) for cut in cuts_m]
    numbers = sensors.groupby("treatment").run.nunique()
    together = int(numbers.max())  # dots on each other darken
    most = max([together, *cover.iloc[:, -1]])
    shades, markers = _shades(int(most)), markers_of(placed)
    with mpl.rc_context(STYLE):
        page, abreast = _sheet(len(settings), views, width, len(markers) > 1)
        figure = page.figure()
        for (i, treatment), (view, cut) in product_of(enumerate(settings), enumerate(cuts_m)):
            row, column = divmod(i, page.columns)
            place = (0, view) if abreast else (row * len(views) + view, column)
            axes = page.axes(figure, *place)
            axes.set_xlabel(AXES[0])
            axes.set_ylabel("" if place[1] else AXES[1])
            own = placed[placed.treatment == treatment]
            shown = cover[(cover.treatment == treatment) & (cover.cut_m == cut)]
            _draw_counts(axes, settings[treatment], shown, views[view], shades)
            if view == 0:
                grey = ["black"] * len(own)
                draw_sensors(axes, own, grey, markers, 2.5, alpha=0.35 if together > 1 else 0.8)
            number = int(numbers[treatment])
            title = _title(treatment, number, cut, len(views), view)
            axes.set_title(title, loc="left", fontsize=7)
            frame(axes, views[view])
        _legends(figure, page, shades, cover.columns[-1], markers)
    return figure


def _shades(most: int) -> Shades:
    """A shade for each number from 1 to ``most``; monotone in grey, too."""
    light_to_dark = mpl.colormaps["YlGnBu"](np.linspace(0.15, 1.0, 256))
    cmap = ListedColormap(light_to_dark)
    return cmap, BoundaryNorm(np.arange(0.5, most + 1), cmap.N)


def _sheet(
    treatments: int, views: Sequence[Window], width: float, types: bool
) -> tuple[Sheet, bool]:
    """Views below each other, treatments abreast; of one treatment on a wide page views abreast.

    ``types`` is whether a legend must tell types of sensors apart.
    """
    bottom = 0.6 if types else 0.4
    ratios = [aspect(view) for view in views]
    if treatments == 1 and width > 2 * PER_ROW_IN + COLUMN_IN / 2:
        one = HEADS_IN[:1]
        return Sheet(
            width, len(views), [max(ratios)], one, right=BAR_IN, bottom=bottom, gap=0.55
        ), True
    columns = max(1, min(treatments, int((width - BAR_IN) / PER_ROW_IN)))
    blocks = math.ceil(treatments / columns)
    columns = math.ceil(treatments / blocks)  # as even as can be
    heads = [HEADS_IN[min(view, 1)] for view in range(len(views))]
    below = [heads[0] + 0.35, *heads[1:]]
    heads = heads + below * (blocks - 1)
    return Sheet(
        width, columns, ratios * blocks, heads, right=BAR_IN, bottom=bottom, gap=0.3
    ), False


def _draw_counts(
    axes: Axes, setting: FigureContext, cover: pd.DataFrame, view: Window, shades: Shades
) -> None:
    """The counts between the robot and its edges."""
    draw_robot(axes, setting)
    draw_robot(axes, setting, fill=False, zorder=3)
    if cover.empty:
        return
    half = float(cover.cell_m.iloc[0]) / 2
    x, y = cells(view, 2 * half)
    axes.imshow(
        raster(cover, x, y),
        origin="lower",
        extent=(y[0] - half, y[-1] + half, x[0] - half, x[-1] + half),
        cmap=shades[0],
        norm=shades[1],
        interpolation="nearest",
        zorder=2,
    )


def _title(treatment: str, number: int, cut_m: float, views: int, view: int) -> str:
    count = f"{number} champion" + "s" * (number > 1)
    how = "at full length," if view == views - 1 else "cut at"
    cones = f"cones {how} {cut_m:g} m" if cut_m else "no sensors"
    whose = count if treatment == ALONE else f"{treatment} ({count})"
    return f"{whose}\n{cones}" if view == 0 else cones


def _legends(
    figure: Figure, page: Sheet, shades: Shades, unit: str, markers: Mapping[str, str]
) -> None:
    tall = min(0.8 * (page.height - page.bottom), 3.0)
    corner = page.width - page.right + 0.15, (page.height - tall) / 2
    bar = figure.colorbar(
        ScalarMappable(shades[1], shades[0]), cax=page.box(figure, corner, (0.1, tall))
    )
    bar.set_label(f"{unit}{chr(10) if tall < 2 else chr(32)}{SEEN}")
    bar.ax.yaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    bar.ax.tick_params(labelsize=7, length=2)
    bar.ax.minorticks_off()
    handles = type_handles(markers)
    if handles:
        figure.legend(handles=handles, loc="lower left", ncols=4, frameon=False)
