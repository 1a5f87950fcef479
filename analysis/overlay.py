"""Many champions on one robot: where their sensors are and what they see (the paper's Fig. 8).

Half a metre of a cone shows how cones and places lie on a robot of half a metre, its whole range of
4.5 m which directions are covered: both are drawn. Overlapping translucent cones would tell no
number, so the shade of a place is a count: of how many champions at least one sensor covers it.
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

from evoros.errors import InputError
from evoros.setting import Setting
from evoros.types import Array

from .designs import champion_or_none
from .product import Product
from .rover import (
    AXES,
    Window,
    aspect,
    covered,
    draw_robot,
    draw_sensors,
    frame,
    length,
    markers_of,
    type_handles,
    window,
)
from .sheet import Sheet
from .study import Study
from .style import COLUMN_IN, STYLE
from .style import width as width_of

HELP = "sensors and cones of the champions on one robot, darker where they coincide (Fig. 8)"
Shades = tuple[ListedColormap, BoundaryNorm]
CELLS = 150  # along a cone: about 0.2 mm each in print
PER_ROW_IN = 1.7  # a panel narrower than this tells nothing
BAR_IN = 0.75  # room for the colour bar
HEADS_IN = (0.38, 0.6)  # room above the first view and above the others
SPAN = ["treatment", "cut_m", "cell_m", "x_m", "y_low_m", "y_high_m", "champions"]
SEEN = "champions whose cones cover a place"


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
    sensors: pd.DataFrame, settings: Mapping[str, Setting], near_m: float | None = None
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


def coverage(
    sensors: pd.DataFrame, settings: Mapping[str, Setting], cuts_m: Sequence[float]
) -> pd.DataFrame:
    """How many champions cover each place around the robot: a row for each span of equal number.

    ``sensors`` has the columns of ``designs.py``, ``settings`` the setting of each treatment.
    Columns: ``treatment``; ``cut_m``, where cones are cut; ``cell_m``, the width of the strip along
    y that the span is part of; ``x_m``, its middle, and from ``y_low_m`` to ``y_high_m``, in the
    robot's frame; ``champions``, those with a sensor whose cone has the centres of the span's
    square cells in it, at least one.
    """
    placed = sensors.dropna(subset="x_m")
    spans = [
        _spans(placed[placed.treatment == treatment], setting, cut).assign(treatment=treatment)
        for treatment, setting in settings.items()
        for cut in cuts_m
    ]
    return pd.concat(spans, ignore_index=True)[SPAN] if spans else pd.DataFrame(columns=SPAN)


def _spans(sensors: pd.DataFrame, setting: Setting, cut: float) -> pd.DataFrame:
    cell = cut / CELLS
    x, y = _cells(window([setting], sensors, cut), cell)
    along, across = np.meshgrid(x, y, indexing="ij")
    count = np.zeros((len(x), len(y)), dtype=np.int64)
    for _, design in sensors.groupby("run"):
        count += covered(design, along, across, cell, cut).astype(np.int64)
    edges = np.pad(count, ((0, 0), (1, 1)))
    row, first = np.nonzero(edges[:, 1:] != edges[:, :-1])  # where another number begins
    last = np.where(np.diff(row, append=-1), 0, np.roll(first, -1))
    span = last > first
    row, first, last = row[span], first[span], last[span]
    table = {"cut_m": cut, "cell_m": cell, "x_m": x[row], "champions": count[row, first]}
    low, high = (y[0] + (end - 0.5) * cell for end in (first, last))
    found = pd.DataFrame(table | {"y_low_m": low.round(9), "y_high_m": high.round(9)})
    return found[found.champions > 0]


def _cells(view: Window, cell: float) -> tuple[Array, Array]:
    """The centres of the cells that fill a window, along x and along y; 0 is a border."""
    x_low, x_high, y_low, y_high = (edge / cell for edge in view)
    x = np.arange(math.floor(x_low), math.ceil(x_high), dtype=np.float64)
    y = np.arange(math.floor(y_low), math.ceil(y_high), dtype=np.float64)
    return ((x + 0.5) * cell).round(9), ((y + 0.5) * cell).round(9)


def overlay(
    cover: pd.DataFrame,
    sensors: pd.DataFrame,
    settings: Mapping[str, Setting],
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
    shades = _shades(int(numbers.max()))
    with mpl.rc_context(STYLE):
        page, abreast = _sheet(len(settings), views, width)
        figure = page.figure()
        for (i, treatment), (view, cut) in product_of(enumerate(settings), enumerate(cuts_m)):
            row, column = divmod(i, page.columns)
            place = (0, view) if abreast else (row * len(views) + view, column)
            axes = page.axes(figure, *place)
            axes.set_xlabel(AXES[0])
            axes.set_ylabel("" if place[1] else AXES[1])
            own = placed[placed.treatment == treatment]
            shown = cover[(cover.treatment == treatment) & (cover.cut_m == cut)]
            draw_robot(axes, settings[treatment])
            _draw_counts(axes, shown, views[view], shades)
            draw_robot(axes, settings[treatment], fill=False, zorder=3)
            if view == 0:
                grey = ["black"] * len(own)
                draw_sensors(axes, own, grey, markers_of(placed), 2.5, alpha=0.35)
            number = int(numbers[treatment])
            title = _title(treatment, number, cut, len(views), view)
            axes.set_title(title, loc="left", fontsize=7)
            frame(axes, views[view])
        _legends(figure, page, shades, markers_of(placed))
    return figure


def _shades(most: int) -> Shades:
    """A shade for each number of champions, from 1; monotone in grey, too."""
    light_to_dark = mpl.colormaps["YlGnBu"](np.linspace(0.15, 1.0, 256))
    cmap = ListedColormap(light_to_dark)
    return cmap, BoundaryNorm(np.arange(0.5, most + 1), cmap.N)


def _sheet(treatments: int, views: Sequence[Window], width: float) -> tuple[Sheet, bool]:
    """Views below each other, treatments abreast; of one treatment on a wide page views abreast."""
    ratios = [aspect(view) for view in views]
    if treatments == 1 and width > 2 * PER_ROW_IN + COLUMN_IN / 2:
        return Sheet(width, len(views), [max(ratios)], HEADS_IN[:1], right=BAR_IN, gap=0.55), True
    columns = max(1, min(treatments, int((width - BAR_IN) / PER_ROW_IN)))
    blocks = math.ceil(treatments / columns)
    columns = math.ceil(treatments / blocks)  # as even as can be
    heads = [HEADS_IN[min(view, 1)] for view in range(len(views))]
    below = [heads[0] + 0.35, *heads[1:]]
    heads = heads + below * (blocks - 1)
    return Sheet(width, columns, ratios * blocks, heads, right=BAR_IN, gap=0.3), False


def _draw_counts(axes: Axes, cover: pd.DataFrame, view: Window, shades: Shades) -> None:
    if cover.empty:
        return
    cell = float(cover.cell_m.iloc[0])
    x, y = _cells(view, cell)
    count = np.zeros((len(x), len(y)), dtype=np.int64)
    rows = np.rint((cover.x_m - x[0]) / cell).astype(int)
    low, high = (
        np.rint((cover[end] - y[0]) / cell + 0.5).astype(int) for end in ("y_low_m", "y_high_m")
    )
    for row, first, last, champions in zip(rows, low, high, cover.champions, strict=True):
        count[row, first:last] = champions
    axes.imshow(
        np.ma.masked_equal(count, 0),
        origin="lower",
        extent=(y[0] - cell / 2, y[-1] + cell / 2, x[0] - cell / 2, x[-1] + cell / 2),
        cmap=shades[0],
        norm=shades[1],
        interpolation="nearest",
        zorder=2,
    )


def _title(treatment: str, number: int, cut_m: float, views: int, view: int) -> str:
    count = f"{number} champion" + "s" * (number > 1)
    how = "at full length," if view == views - 1 else "cut at"
    cones = f"cones {how} {cut_m:g} m" if cut_m else "no sensors"
    return f"{treatment} ({count})\n{cones}" if view == 0 else cones


def _legends(figure: Figure, page: Sheet, shades: Shades, markers: Mapping[str, str]) -> None:
    tall = min(0.8 * (page.height - page.bottom), 3.0)
    corner = page.width - page.right + 0.15, (page.height - tall) / 2
    bar = figure.colorbar(
        ScalarMappable(shades[1], shades[0]), cax=page.box(figure, corner, (0.1, tall))
    )
    bar.set_label(SEEN if tall > 2 else SEEN.replace(" whose", "\nwhose"))
    bar.ax.yaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    bar.ax.tick_params(labelsize=7, length=2)
    bar.ax.minorticks_off()
    handles = type_handles(markers)
    if handles:
        figure.legend(handles=handles, loc="lower left", ncols=4, frameon=False)
