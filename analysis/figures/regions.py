"""The regions where sensors may be placed, and the allowed headings (Fig. 5)."""

import argparse
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.design.protocol import Area, Point, Range
from evoros.storage.figure_context import FigureContext

from ..designs.cones import CONE, Window, fit_window, outline_part, robot_length, trace_sector
from ..drawing.robot import AXES, aspect_ratio, draw_robot, frame_axes, to_page
from ..drawing.sheet import Sheet
from ..drawing.style import CATEGORIES, COLUMN_IN, figure_width, scale_type, use_style
from ..subcommands import Product
from ..tables.study import Study

ONE_ROBOT = True
HELP = "regions of the robot in which sensors may be placed, and allowed headings (Fig. 5)"
NEEDS = "runs"
FILES = ("regions.csv",)
FAN = 0.25  # radius of a fan, in robot lengths
TWINS = "twins are mirrored across the dash-dotted line"
MINUS = "\N{MINUS SIGN}"
MAX_FANS = 3  # maximum number of fans along a line region
PANEL_IN, SINGLE_IN = 2.5, 4.5  # minimum width of a panel, and maximum width of a single panel


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw a panel per robot and set of regions in the runs and evaluations."""
    contexts = _group_contexts(study)
    if not contexts:
        raise InputError("regions: no run places sensors in regions; add a run with design=around")
    width = figure_width(options.columns, 1 if len(contexts) == 1 else 2)
    named = any(record.agent or record.context.agents for record in study.records)
    return Product(list_regions(contexts), draw_regions(contexts, width, named))


def _group_contexts(study: Study) -> dict[str, FigureContext]:
    """Merge contexts that look the same, and name the result after all treatments."""
    treatments: dict[str, list[str]] = {}
    contexts: dict[str, FigureContext] = {}
    for record in (*study.records, *study.evaluations):
        context = record.context
        if context.regions:
            key = repr((context.robot, context.parts, context.regions, context.mirrored))
            contexts.setdefault(key, context)
            treatments.setdefault(key, []).append(record.treatment)
    labels = {key: list(dict.fromkeys(names)) for key, names in treatments.items()}
    return {
        f"{first} and {len(others)} more" if others else first: contexts[key]
        for key, (first, *others) in labels.items()
    }


def list_regions(contexts: Mapping[str, FigureContext]) -> pd.DataFrame:
    """List a row per region and, if sensors have twins, a row for the mirror image."""
    rows = [
        {"treatment": treatment, "robot": context.robot, "region": name, "twin": twin}
        | {f"{'xy'[k]}{i}_m": c[k] for i, c in enumerate(area.corners) for k in (0, 1)}
        | {"yaw_low_deg": area.yaw_deg[0], "yaw_high_deg": area.yaw_deg[1]}
        for treatment, context in contexts.items()
        for twin in ((False, True) if context.mirrored else (False,))
        for name, region in context.regions.items()
        for area in [_mirror(region) if twin else region]
    ]
    return pd.DataFrame(rows)


def _mirror(area: Area) -> Area:
    return replace(
        area,
        corners=tuple((x, 0.0 - y) for x, y in area.corners),
        yaw_deg=_flip(area.yaw_deg),
        facing_deg=tuple(map(_flip, area.facing_deg)),
    )


def _flip(headings: tuple[float, float]) -> tuple[float, float]:
    return 0.0 - headings[1], 0.0 - headings[0]


def draw_regions(
    contexts: Mapping[str, FigureContext], width: float = COLUMN_IN, named: bool = False
) -> Figure:
    """Draw a panel per context with the robot, its regions, and fans of headings."""
    reach = FAN * max(map(robot_length, contexts.values()))
    view = _fit_window(contexts, reach)
    columns = max(1, min(len(contexts), int(width / PANEL_IN)))
    rows = math.ceil(len(contexts) / columns)
    with use_style():
        heads = [0.3 if len(contexts) == 1 else 0.45, *[0.8] * (rows - 1)]
        spare = max(0.0, width - SINGLE_IN) / 2 if columns == 1 else 0.0
        sides = {"left": 0.56 + spare, "right": 0.08 + spare}
        sheet = Sheet(width, columns, [aspect_ratio(view)] * rows, heads, gap=0.5, **sides)
        figure = sheet.make_figure()
        for i, (treatment, context) in enumerate(contexts.items()):
            axes = sheet.add_panel(figure, *divmod(i, columns))
            draw_robot(axes, context)
            _draw_areas(axes, context, reach)
            frame_axes(axes, view)
            axes.set(xlabel=AXES[0], ylabel=AXES[1])
            title = [treatment] * (len(contexts) > 1 or named) + [TWINS] * context.mirrored
            axes.set_title("\n".join(title), fontsize="small", loc="left")
    return figure


def _fit_window(contexts: Mapping[str, FigureContext], reach: float) -> Window:
    corners = [
        (x, y, 0.0, 360.0, scale_type(3.4 if area.facing_deg else 2.4) * reach)
        for context in contexts.values()
        for area in context.regions.values()
        for x, y in area.corners
    ]
    return fit_window(contexts.values(), pd.DataFrame(corners, columns=CONE), math.inf)


def _draw_areas(axes: Axes, context: FigureContext, reach: float) -> None:
    places = [_corners(area) for area in context.regions.values()]
    for i, (name, area) in enumerate(context.regions.items()):
        image = _corners(_mirror(area))
        partners = [k for k, place in enumerate(places) if place == image]
        colour = CATEGORIES[min(i, *partners, i) % len(CATEGORIES)]
        _draw_area(axes, area, reach, colour, twin=False)
        _write_name(axes, name, area, reach)
        if context.mirrored and not partners:
            _draw_area(axes, _mirror(area), reach, colour, twin=True)
    if context.mirrored:
        nose = max(outline_part(part)[:, 0].max() for part in context.parts)
        axes.plot([0.0, 0.0], [-1e3, nose], color="0.3", lw=0.6, ls="-.", zorder=3)


def _corners(area: Area) -> frozenset[tuple[float, float]]:
    return frozenset((round(x, 9), round(y, 9)) for x, y in area.corners)


def _draw_area(axes: Axes, area: Area, reach: float, colour: str, twin: bool) -> None:
    style: dict[str, Any] = {"ec": colour, "lw": 0.8, "ls": "--" if twin else "-"}

    def fill(points: Array, alpha: float, order: int) -> None:
        face = "none" if twin else (colour, alpha)
        axes.fill(*to_page(points).T, fc=face, zorder=order, **style)

    for (x, y), (low, high) in _fans(area):
        fill(trace_sector(x, y, (low + high) / 2, high - low, reach), 0.25, 2)
    if area.facing_deg:
        line = to_page(np.array(area.corners)).T
        axes.plot(*line, color=colour, lw=2.5, ls=style["ls"], solid_capstyle="butt", zorder=3)
    else:
        fill(np.array(area.corners), 0.7, 3)


def _fans(area: Area) -> list[tuple[Point, Range]]:
    if not area.facing_deg:
        x, y = np.mean(area.corners, axis=0)
        return [((float(x), float(y)), area.yaw_deg)]
    count = len(area.facing_deg)
    steps = np.linspace(0, count - 1, min(count, MAX_FANS)).round().astype(int).tolist()
    corners = np.array(area.corners)
    ends = [corners[[i, min(i + 1, len(corners) - 1)]].mean(axis=0).tolist() for i in steps]
    return [((x, y), area.facing_deg[i]) for (x, y), i in zip(ends, steps, strict=True)]


def _write_name(axes: Axes, name: str, area: Area, reach: float) -> None:
    fans, (low, high) = _fans(area), area.yaw_deg
    (x, y), middle = fans[len(fans) // 2]
    heading = (middle[0] + middle[1]) / 2
    tip = trace_sector(x, y, heading, 0.0, 1.15 * reach)[1]
    aside = math.sin(math.radians(heading))
    ha = "center" if abs(aside) < 0.3 else "right" if aside > 0 else "left"
    behind = bool(area.facing_deg) and math.cos(math.radians(heading)) < -0.3
    va = "top" if abs(aside) > 0.8 or behind else "bottom"
    form = ".0f" if area.facing_deg else "g"  # normals of curved outlines have many digits
    ends = list(dict.fromkeys((f"{low:{form}}", f"{high:{form}}")))
    headings = f"{' to '.join(ends)}°"
    text = f"{name.replace('_', ' ')}\n{headings.replace('-', MINUS)}"
    axes.text(tip[1], tip[0], text, fontsize="small", ha=ha, va=va, zorder=5)
