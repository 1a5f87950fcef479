"""Where sensors may be and where they may face (the paper's Fig. 5)."""

import argparse
import math
from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evoros.base.errors import InputError
from evoros.storage.figure_context import Area, FigureContext

from ..drawing.robot import (
    AXES,
    CONE,
    Window,
    aspect,
    draw_robot,
    fan,
    frame,
    length,
    outline,
    page,
    window,
)
from ..drawing.sheet import Sheet
from ..drawing.style import CATEGORIES, COLUMN_IN, STYLE
from ..drawing.style import width as width_of
from ..product import Product
from ..tables.study import Study

HELP = "where on the robot sensors may be, and where they may face (Fig. 5)"
FAN = 0.25  # of the robot's length
TWINS = "twins are mirrored across the dash-dotted line"
PANEL_IN, SINGLE_IN = 2.5, 4.5  # the least width of a panel, the greatest of one alone


def product(study: Study, options: argparse.Namespace) -> Product:
    """The command's: a panel for each robot and set of regions among the runs and evaluations."""
    settings = distinct(study)
    if not settings:
        raise InputError("regions: no run places sensors in regions; give one whose design does")
    wide = width_of(options.columns, 1 if len(settings) == 1 else 2)
    return Product(table(settings), regions(settings, wide))


def distinct(study: Study) -> dict[str, FigureContext]:
    """The settings that differ in what is drawn, by the treatments that have them."""
    named: dict[str, list[str]] = {}
    settings: dict[str, FigureContext] = {}
    for record in (*study.records, *study.evaluations):
        setting = record.setting
        if setting.regions:
            key = repr((setting.robot, setting.parts, setting.regions, setting.mirrored))
            settings.setdefault(key, setting)
            named.setdefault(key, []).append(record.treatment)
    return {_named(list(dict.fromkeys(named[key]))): settings[key] for key in settings}


def _named(treatments: Sequence[str]) -> str:
    first, *more = treatments
    return f"{first} and {len(more)} more" if more else first


def table(settings: Mapping[str, FigureContext]) -> pd.DataFrame:
    """A row for each region, and one for its mirror image where sensors have twins.

    Columns: treatment, robot, region, ``twin``, whether it is where twins are, corners ``x0_m``,
    ``y0_m`` ... ``y3_m`` in the robot's frame, and headings from ``yaw_low_deg`` to
    ``yaw_high_deg``.
    """
    rows = [
        {"treatment": treatment, "robot": setting.robot, "region": name, "twin": twin}
        | {f"{'xy'[k]}{i}_m": c[k] for i, c in enumerate(area.corners) for k in (0, 1)}
        | {"yaw_low_deg": area.yaw_deg[0], "yaw_high_deg": area.yaw_deg[1]}
        for treatment, setting in settings.items()
        for twin in ((False, True) if setting.mirrored else (False,))
        for name, own in setting.regions.items()
        for area in [_mirrored(own) if twin else own]
    ]
    return pd.DataFrame(rows)


def _mirrored(area: Area) -> Area:
    low, high = area.yaw_deg
    return Area(tuple((x, 0.0 - y) for x, y in area.corners), (0.0 - high, 0.0 - low))


def regions(settings: Mapping[str, FigureContext], width: float = COLUMN_IN) -> Figure:
    """A panel a setting, by its treatments: the robot and its regions, with fans of headings.

    A region is coloured as the one that it mirrors. Where twins are and no region is, edges are
    dashed. ``width`` is in inches.
    """
    reach = FAN * max(map(length, settings.values()))
    view = _window(settings, reach)
    columns = max(1, min(len(settings), int(width / PANEL_IN)))
    rows = math.ceil(len(settings) / columns)
    with mpl.rc_context(STYLE):
        heads = [0.3 if len(settings) == 1 else 0.45, *[0.8] * (rows - 1)]
        spare = max(0.0, width - SINGLE_IN) / 2 if columns == 1 else 0.0
        sides = {"left": 0.56 + spare, "right": 0.08 + spare}
        sheet = Sheet(width, columns, [aspect(view)] * rows, heads, gap=0.5, **sides)
        figure = sheet.figure()
        for i, (treatment, setting) in enumerate(settings.items()):
            axes = sheet.axes(figure, *divmod(i, columns))
            draw_robot(axes, setting)
            _draw_regions(axes, setting, reach)
            frame(axes, view)
            axes.set(xlabel=AXES[0], ylabel=AXES[1])
            said = [treatment] * (len(settings) > 1) + [TWINS] * setting.mirrored
            axes.set_title("\n".join(said), fontsize=7, loc="left")
    return figure


def _window(settings: Mapping[str, FigureContext], reach: float) -> Window:
    """The robots and the fans, with room for names beside and before them."""
    corners = [
        (x, y, 0.0, 360.0, 1.8 * reach)
        for setting in settings.values()
        for area in setting.regions.values()
        for x, y in area.corners
    ]
    return window(settings.values(), pd.DataFrame(corners, columns=CONE), math.inf)


def _draw_regions(axes: Axes, setting: FigureContext, reach: float) -> None:
    places = [_corners(area) for area in setting.regions.values()]
    for i, (name, area) in enumerate(setting.regions.items()):
        image = _corners(_mirrored(area))
        partners = [k for k, place in enumerate(places) if place == image]
        colour = CATEGORIES[min(i, *partners, i) % len(CATEGORIES)]
        _draw_area(axes, area, reach, colour, twin=False)
        _name(axes, name, area, reach)
        if setting.mirrored and not partners:
            _draw_area(axes, _mirrored(area), reach, colour, twin=True)
    if setting.mirrored:
        nose = max(outline(part)[:, 0].max() for part in setting.parts)
        axes.plot([0.0, 0.0], [-1e3, nose], color="0.3", lw=0.6, ls="-.", zorder=3)


def _corners(area: Area) -> frozenset[tuple[float, float]]:
    """For telling whether two areas are the same place."""
    return frozenset((round(x, 9), round(y, 9)) for x, y in area.corners)


def _draw_area(axes: Axes, area: Area, reach: float, colour: str, twin: bool) -> None:
    (x, y), (low, high) = _middle(area), area.yaw_deg
    sector = fan(x, y, (low + high) / 2, high - low, reach)
    for points, alpha, order in ((np.array(area.corners), 0.7, 3), (sector, 0.25, 2)):
        axes.fill(
            *page(points).T,
            fc="none" if twin else (colour, alpha),
            ec=colour,
            lw=0.8,
            ls="--" if twin else "-",
            zorder=order,
        )


def _middle(area: Area) -> tuple[float, float]:
    x, y = np.mean(area.corners, axis=0)
    return float(x), float(y)


def _name(axes: Axes, name: str, area: Area, reach: float) -> None:
    """The name and the headings of a region, outside of its fan."""
    (x, y), (low, high) = _middle(area), area.yaw_deg
    tip = fan(x, y, (low + high) / 2, 0.0, 1.15 * reach)[1]
    aside = math.sin(math.radians((low + high) / 2))
    ha = "center" if abs(aside) < 0.3 else "right" if aside > 0 else "left"
    va = "top" if abs(aside) > 0.8 else "bottom"
    headings = f"{low:g}°" if low == high else f"{low:g} to {high:g}°"
    said = f"{name}\n{headings}".replace("-", "\N{MINUS SIGN}")
    axes.text(tip[1], tip[0], said, fontsize=6.5, ha=ha, va=va, zorder=5)
