"""What a blow breaks: the rings of spatial failure around a design's sensors (Fig. 10)."""

import argparse
import math
from collections.abc import Sequence
from dataclasses import replace

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext, Ring

from ..drawing.robot import AXES, Window, aspect, draw_robot, frame
from ..drawing.sheet import Sheet
from ..drawing.style import COLUMN_IN, STYLE, VERMILLION
from ..drawing.style import width as width_of
from ..product import Product
from ..tables.designs import champion_sensors
from ..tables.records import Record
from ..tables.study import Study

HELP = "what spatial failure breaks around each sensor of one champion (Fig. 10)"
PANEL_IN = 1.4  # the least width of a panel
FLAT = 0.65  # least height of a panel over its width
LABEL_IN, LINE_IN, TICK_IN = 0.42, 0.11, 0.06  # a sensor's label: across, up, and to its sensor


def arguments(parser: argparse.ArgumentParser) -> None:
    """The option of this subcommand."""
    parser.add_argument("--run", metavar="NAME", help="the run whose champion is drawn; the best")


def product(study: Study, options: argparse.Namespace) -> Product:
    """The command's: of the named run, or of the best one that has spatial failure."""
    hit = replace(study, records=tuple(each for each in study.records if each.setting.rings))
    if not hit.records:
        raise InputError("failure: no run has spatial failure; give one with failure=spatial")
    chosen, sensors = hit.chosen(options.run, _sensors)
    table = damage(sensors, chosen.setting.rings)
    figure = failure(table, chosen.setting, width_of(options.columns, 2))
    return Product(table, figure, [_said(chosen, len(hit.records), len(study.records))])


def _sensors(record: Record) -> pd.DataFrame:
    """Of a champion that has any."""
    if champion_sensors(record).empty:
        raise InputError(
            f"{record.path}: must have a champion with sensors, and has one without; "
            f"choose another with --run"
        )
    return Study((record,)).gather(champion_sensors)


def _said(chosen: Record, hit: int, runs: int) -> str:
    others = f"; the other {runs - hit} runs have none" if runs > hit else ""
    return f"failure: champion of {chosen.name}, of {hit} with spatial failure{others}"


def damage(sensors: pd.DataFrame, rings: Sequence[Ring]) -> pd.DataFrame:
    """How likely each sensor of one design fails when each is hit: a row for each two of them.

    ``sensors`` has the columns of ``designs.py``. Columns: run, treatment, seed, design; ``centre``
    and its ``pair``, the sensor that is hit; ``sensor``, its place ``x_m``, ``y_m`` in the robot's
    frame and its ``distance_m`` in space, 0 for the centre itself; ``radius_m`` of the least ring
    that reaches it, empty where none does, and its ``probability``, 0 there.
    """
    both = sensors.merge(
        sensors[["x_m", "y_m", "z_m", "sensor", "pair"]].rename(columns={"sensor": "centre"}),
        how="cross",
        suffixes=("", "_centre"),
    )
    both = both.sort_values(["centre", "sensor"], ignore_index=True)
    apart = [both[f"{axis}_m"] - both[f"{axis}_m_centre"] for axis in "xyz"]
    distance = np.linalg.norm(np.array(apart, dtype=np.float64), axis=0)
    ordered = sorted(rings, key=lambda ring: ring.radius_m)
    reach = np.searchsorted([ring.radius_m for ring in ordered], distance)  # as the failure does
    radii = np.array([*(ring.radius_m for ring in ordered), math.nan])
    chances = np.array([*(ring.probability for ring in ordered), 0.0])
    both = (
        both.assign(distance_m=distance, radius_m=radii[reach], probability=chances[reach])
        .drop(columns="pair")
        .rename(columns={"pair_centre": "pair"})
    )
    head = ["run", "treatment", "seed", "design", "centre", "pair", "sensor", "x_m", "y_m"]
    return both[[*head, "distance_m", "radius_m", "probability"]]


def failure(table: pd.DataFrame, setting: FigureContext, width: float = 2 * COLUMN_IN) -> Figure:
    """A panel for each sensor that is hit, of mirrored twins one: the other's is its mirror image.

    ``table`` is what ``damage`` gives; ``width`` is in inches.
    """
    rings = sorted(setting.rings, key=lambda ring: ring.radius_m)
    itself = table[table.centre == table.sensor].sort_values(["pair", "y_m"])
    hits = itself.drop_duplicates("pair", keep="last").centre.tolist()  # of twins the left one
    most = max(1, min(len(hits), int((width - 0.5) / PANEL_IN)))
    columns = math.ceil(len(hits) / math.ceil(len(hits) / most))
    rows = math.ceil(len(hits) / columns)
    view = _window(table, rings[-1].radius_m, Sheet(width, columns, [], []).panel)
    bottom = 0.8 if width > COLUMN_IN else 1.1
    page = Sheet(width, columns, [aspect(view)] * rows, [0.4] * rows, bottom=bottom)
    with mpl.rc_context(STYLE):
        figure = page.figure()
        for i, centre in enumerate(hits):
            axes = page.axes(figure, *divmod(i, columns))
            draw_robot(axes, setting)
            hit = table[table.centre == centre]
            _draw_rings(axes, hit, rings)
            _draw_sensors(axes, hit, 2 * view[3] / page.panel)
            twins = table[table.pair == hit.pair.iloc[0]].centre.unique()
            axes.set_title(_title(hit, twins), fontsize=7, loc="left", pad=3)
            frame(axes, view)
            last = i + columns >= len(hits)
            axes.set(ylabel="" if i % columns else AXES[1], xlabel=AXES[0] if last else "")
            axes.tick_params(labelbottom=last, labelleft=not i % columns)
        _legend(figure, rings, 3 if width > COLUMN_IN else 1)
    return figure


def _window(table: pd.DataFrame, reach: float, panel_in: float) -> Window:
    """The sensors with the rings around them, and room for labels on both sides."""
    x_low, x_high = table.x_m.min() - reach - 0.01, table.x_m.max() + reach + 0.01
    aside = float(table.y_m.abs().max())
    y = max(aside + reach + 0.01, aside / (1 - 2 * (LABEL_IN + TICK_IN) / panel_in))
    grow = max(0.0, 2 * y * FLAT - (x_high - x_low)) / 2
    return float(x_low) - grow, float(x_high) + grow, -y, y


def _shade(probability: float) -> str:
    """Grey, the darker the likelier: the same in print without colour."""
    return f"{1 - 0.85 * probability:.3f}"


def _draw_rings(axes: Axes, hit: pd.DataFrame, rings: Sequence[Ring]) -> None:
    """Around the sensor that is hit, the widest below the others."""
    centre = hit[hit.sensor == hit.centre].iloc[0]
    for order, ring in enumerate(reversed(rings)):
        axes.add_patch(
            Circle(
                (centre.y_m, centre.x_m),
                ring.radius_m,
                fc=VERMILLION,
                ec=VERMILLION,
                alpha=0.25,
                lw=0.6,
                zorder=2 + order / 10,
            )
        )
    axes.plot(centre.y_m, centre.x_m, "+", color="black", ms=9, mew=0.8, zorder=5)


def _draw_sensors(axes: Axes, hit: pd.DataFrame, scale: float) -> None:
    """Each sensor, as dark as it is likely to fail, and at its side its number and how likely.

    ``scale`` is that of the page [m/in].
    """
    aside, line = float(hit.y_m.abs().max()) + TICK_IN * scale, LINE_IN * scale
    for side in (1, -1):
        own = hit[(hit.y_m >= 0) == (side > 0)].sort_values("x_m")
        cells = own[["sensor", "x_m", "y_m", "probability"]].to_numpy(dtype=np.float64).tolist()
        for (sensor, x, y, chance), level in zip(
            cells, _apart([row[1] for row in cells], line), strict=True
        ):
            axes.plot(y, x, "o", mfc=_shade(chance), mec="black", mew=0.5, ms=4, zorder=4)
            axes.plot([y, side * aside], [x, level], color="0.3", lw=0.4, zorder=3)
            axes.text(
                side * aside,
                level,
                f" {sensor:.0f}: {chance:.2f} ",
                fontsize=6.5,
                ha="right" if side > 0 else "left",
                va="center",
                weight="bold" if chance > 0 else "normal",
                zorder=5,
            )


def _apart(places: Sequence[float], least: float) -> list[float]:
    """Increasing places moved upwards until neighbours are ``least`` apart, then all to centre."""
    moved: list[float] = []
    for place in places:
        moved.append(max([place, *(before + least for before in moved[-1:])]))
    shift = (sum(places) - sum(moved)) / max(len(places), 1)
    return [place + shift for place in moved]


def _title(hit: pd.DataFrame, twins: Sequence[int]) -> str:
    centre = hit.centre.iloc[0]
    mirrored = "".join(f" (mirrored: {twin})" for twin in twins if twin != centre)
    lost = hit.probability.sum()
    return f"sensor {centre} hit{mirrored}\n{lost:.1f} of {len(hit)} fail on average"


def _legend(figure: Figure, rings: Sequence[Ring], columns: int) -> None:
    handles = [
        Line2D(
            [],
            [],
            ls="none",
            marker="o",
            mfc=_shade(ring.probability),
            mec="black",
            mew=0.5,
            ms=4,
            label=f"within {100 * ring.radius_m:g} cm: {ring.probability:.2f}",
        )
        for ring in rings
    ]
    figure.legend(
        handles=handles,
        title="sensor: probability that it fails",
        loc="lower center",
        ncols=columns,
        frameon=False,
    )
