"""Sensors lost to damage: rings of spatial failure around each sensor of a design (Fig. 10)."""

import argparse
import math
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle

from evoros.analysis.designs.cones import Window
from evoros.analysis.drawing.paper import label_sensors
from evoros.analysis.drawing.robot import AXES, aspect_ratio, draw_robot, frame_axes
from evoros.analysis.drawing.sheet import Sheet
from evoros.analysis.drawing.style import COLUMN_IN, VERMILLION, figure_width, use_style
from evoros.analysis.subcommands import Product, add_run
from evoros.analysis.tables.champions import read_champion_sensors
from evoros.analysis.tables.records import Record
from evoros.analysis.tables.study import Study
from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext, Ring

ONE_ROBOT = True
HELP = "sensors destroyed by spatial damage centred at each sensor of a champion (Fig. 10)"
NEEDS = "a run with spatial failure"
FILES = ("failure.csv",)
add_arguments = add_run
PANEL_IN = 1.4  # minimum width [in] of a panel
MIN_RATIO = 0.65  # minimum ratio of height to width of a panel
LABEL_IN, LINE_IN, TICK_IN = 0.42, 0.11, 0.06  # width, height and distance [in] of a sensor's label
_SENSOR: dict[str, Any] = {"marker": "o", "mec": "black", "mew": 0.5, "ms": 4, "ls": "none"}


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the champion of the named run (default: the best run with spatial failure)."""
    spatial = study.keep(record for record in study.records if record.context.rings)
    if not spatial.records:
        raise InputError("failure: no run has spatial failure; add a run with failure=spatial")
    record, sensors = spatial.choose(options.run, partial(_read_sensors, study=spatial), True)
    table = list_damage(sensors, record.context.rings)
    figure = draw_failure(table, record.context, figure_width(options.columns, 2))
    hit, others = len(spatial.records), len(study.records) - len(spatial.records)
    rest = f"; the other {others} have no spatial failure" if others else ""
    message = f"failure: champion of {record.name}, one of {hit} runs with spatial failure{rest}"
    return Product(table, figure, [message])


def _read_sensors(record: Record, study: Study) -> pd.DataFrame:
    if read_champion_sensors(record).empty:
        raise InputError(
            f"{record.path}: the champion has no sensors to damage; choose another run with --run"
        )
    return study.keep([record]).gather(read_champion_sensors)


def list_damage(sensors: pd.DataFrame, rings: Sequence[Ring]) -> pd.DataFrame:
    """List the probability that a sensor fails if another is hit, for each pair of sensors."""
    both = sensors.merge(
        sensors[["x_m", "y_m", "z_m", "sensor", "pair"]].rename(columns={"sensor": "centre"}),
        how="cross",
        suffixes=("", "_centre"),
    )
    both = both.sort_values(["centre", "sensor"], ignore_index=True)
    offsets = [both[f"{axis}_m"] - both[f"{axis}_m_centre"] for axis in "xyz"]
    distance = np.linalg.norm(np.array(offsets, dtype=np.float64), axis=0)
    ordered = sorted(rings, key=lambda ring: ring.radius_m)
    reach = np.searchsorted([ring.radius_m for ring in ordered], distance)
    radii = np.array([*(ring.radius_m for ring in ordered), math.nan])
    chances = np.array([*(ring.probability for ring in ordered), 0.0])
    both = both.assign(distance_m=distance, radius_m=radii[reach], probability=chances[reach])
    both = both.drop(columns="pair").rename(columns={"pair_centre": "pair"})
    head = ["run", "treatment", "seed", "design", "centre", "pair", "sensor", "x_m", "y_m"]
    return both[[*head, "distance_m", "radius_m", "probability"]]


def draw_failure(
    table: pd.DataFrame, context: FigureContext, width: float = 2 * COLUMN_IN
) -> Figure:
    """Draw a panel per sensor hit, one for each mirrored pair; ``width`` is in inches."""
    rings = sorted(context.rings, key=lambda ring: ring.radius_m)
    centres = table[table.centre == table.sensor].sort_values(["pair", "y_m"])
    hits = centres.drop_duplicates("pair", keep="last").centre.tolist()  # left sensor of each pair
    columns = max(1, min(len(hits), int((width - 0.5) / PANEL_IN)))
    columns = math.ceil(len(hits) / math.ceil(len(hits) / columns))
    rows = math.ceil(len(hits) / columns)
    view = _fit_window(table, rings[-1].radius_m, Sheet(width, columns, [], []).panel)
    bottom = 0.8 if width > COLUMN_IN else 1.1
    page = Sheet(width, columns, [aspect_ratio(view)] * rows, [0.4] * rows, bottom=bottom)
    with use_style():
        figure = page.make_figure()
        for i, centre in enumerate(hits):
            axes = page.add_panel(figure, *divmod(i, columns))
            draw_robot(axes, context)
            hit = table[table.centre == centre]
            _draw_rings(axes, hit, rings)
            _draw_sensors(axes, hit, 2 * view[3] / page.panel)
            twins = table[table.pair == hit.pair.iloc[0]].centre.unique()
            axes.set_title(_title(hit, twins), fontsize="small", loc="left", pad=3)
            frame_axes(axes, view)
            last = i + columns >= len(hits)
            axes.set(ylabel="" if i % columns else AXES[1], xlabel=AXES[0] if last else "")
            axes.tick_params(labelbottom=last, labelleft=not i % columns)
        _add_legend(figure, rings, 3 if width > COLUMN_IN else 1)
    return figure


def _fit_window(table: pd.DataFrame, reach: float, panel_in: float) -> Window:
    x_low, x_high = table.x_m.min() - reach - 0.01, table.x_m.max() + reach + 0.01
    aside = float(table.y_m.abs().max())
    y = max(aside + reach + 0.01, aside / (1 - 2 * (LABEL_IN + TICK_IN) / panel_in))
    margin = max(0.0, 2 * y * MIN_RATIO - (x_high - x_low)) / 2
    return float(x_low) - margin, float(x_high) + margin, -y, y


def _shade(probability: float) -> str:
    return f"{1 - 0.85 * probability:.3f}"


def _draw_rings(axes: Axes, hit: pd.DataFrame, rings: Sequence[Ring]) -> None:
    centre = hit[hit.sensor == hit.centre].iloc[0]
    for order, ring in enumerate(reversed(rings)):
        look: dict[str, Any] = {"fc": VERMILLION, "ec": VERMILLION, "alpha": 0.25, "lw": 0.6}
        place = (centre.y_m, centre.x_m)
        axes.add_patch(Circle(place, ring.radius_m, zorder=2 + order / 10, **look))
    axes.plot(centre.y_m, centre.x_m, "+", color="black", ms=9, mew=0.8, zorder=5)


def _draw_sensors(axes: Axes, hit: pd.DataFrame, scale: float) -> None:
    for y, x, chance in hit[["y_m", "x_m", "probability"]].to_numpy(dtype=np.float64).tolist():
        axes.plot(y, x, mfc=_shade(chance), zorder=4, **_SENSOR)
    texts = [f"{n}: {p:.2f}" for n, p in zip(hit.sensor, hit.probability, strict=True)]
    labels = hit.assign(label=texts, bold=hit.probability > 0)
    aside = float(hit.y_m.abs().max()) + TICK_IN * scale
    label_sensors(axes, labels, aside, LINE_IN * scale)


def _title(hit: pd.DataFrame, twins: Sequence[int]) -> str:
    centre = hit.centre.iloc[0]
    mirrored = "".join(f" (mirrored: {twin})" for twin in twins if twin != centre)
    lost = hit.probability.sum()
    return f"sensor {centre} hit{mirrored}\n{lost:.1f} of {len(hit)} fail on average"


def _add_legend(figure: Figure, rings: Sequence[Ring], columns: int) -> None:
    labels = [f"within {100 * ring.radius_m:g} cm: {ring.probability:.2f}" for ring in rings]
    handles = [
        Line2D([], [], mfc=_shade(ring.probability), label=label, **_SENSOR)
        for ring, label in zip(rings, labels, strict=True)
    ]
    look: dict[str, Any] = {"title": "probability of a sensor's failure", "frameon": False}
    figure.legend(handles=handles, loc="lower center", ncols=columns, **look)
