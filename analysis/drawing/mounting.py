"""A drawing of where to mount sensors on a robot: from above, from the right, and as a table."""

from collections.abc import Mapping
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Wedge

from evoros.base.arrays import Array
from evoros.geometry.footprint import convex_hull

from .mounting_plan import MountingPlan, PlacedSensor, X, Y, Z
from .mounting_text import (
    ARROW,
    LINE,
    dimension_above,
    dimension_side,
    label_above,
    label_side,
    list_notes,
    mark_point,
    write_table,
)
from .paper import (
    DARK,
    GREY,
    INCH_MM,
    MEDIUM,
    TEXT_PT,
    THIN,
    TITLE_PT,
    View,
    choose_scale,
    draw_scale_bar,
    make_page,
)
from .style import BLUE, PAGE_IN, VERMILLION, use_style

_BODY, _WHEEL = "0.9", "0.72"
_LEFT, _RIGHT = 16.0, 42.0  # margins beside the views [mm]
_ABOVE, _BETWEEN, _BELOW = 38.0, 40.0, 17.0  # room over, between and under the views [mm]
_TALL, _MINIMUM = 280.0, 60.0  # height of the page that printers can fill, and of both views [mm]
_FAN = 9.0  # length of the field of view of a sensor on the page [mm]


def draw_mounting(plan: MountingPlan) -> Figure:
    """Draw a plan to scale on a page as wide as two columns."""
    width = PAGE_IN * INCH_MM
    low, high = plan.bounds
    notes = list(list_notes(plan))
    footer = LINE * (len(notes) + len(plan.sensors) + 3) + 13.0
    room = max(_TALL - _ABOVE - _BETWEEN - _BELOW - footer, _MINIMUM)
    length, breadth, tall = (high - low).tolist()
    scale = max(choose_scale(length, width - _LEFT - _RIGHT), choose_scale(breadth + tall, room))
    sizes = (high - low) / scale
    height = _ABOVE + sizes[Y] + _BETWEEN + sizes[Z] + _BELOW + footer
    left = (width - _LEFT - _RIGHT - sizes[X]) / 2 + _LEFT - low[X] / scale
    side = View(X, Z, scale, (left, footer + _BELOW - low[Z] / scale))
    above = View(X, Y, scale, (left, footer + _BELOW + sizes[Z] + _BETWEEN - low[Y] / scale))
    with use_style():
        figure, axes = make_page(width, height)
        axes.text(4.0, height - 5.0, plan.title, fontsize=TITLE_PT, weight="bold", va="center")
        axes.text(4.0, height - 9.5, plan.source, fontsize=TEXT_PT, color=GREY, va="center")
        _draw_view(axes, plan, above)
        _draw_view(axes, plan, side)
        dimension_above(axes, plan, above, height - 20.0)
        dimension_side(axes, plan, side)
        label_above(axes, plan, above)
        label_side(axes, plan, side)
        draw_scale_bar(axes, (6.0, footer - 8.0), scale)
        write_table(axes, plan, notes, footer - 13.0)
    return figure


def _draw_view(axes: Axes, plan: MountingPlan, view: View) -> None:
    """Draw the robot, its sensors and its datum; the nearest to the viewer comes last."""
    depth, sign = (Z, 1.0) if view.up == Y else (Y, -1.0)
    for solid in sorted(plan.solids, key=lambda s: float((sign * s.points_mm[:, depth]).max())):
        look = {"fc": _WHEEL if solid.wheel else _BODY, "ec": GREY, "alpha": 0.9}
        _fill(axes, view, solid.points_mm, look)
    for sensor in plan.sensors:
        if len(sensor.corners_mm):
            _fill(axes, view, sensor.corners_mm, {"fc": BLUE, "ec": DARK, "alpha": 1.0})
        _draw_beam(axes, sensor, view)
    low, high = plan.bounds
    chain: dict[str, Any] = {"color": GREY, "lw": THIN, "ls": (0, (12, 3, 2, 3))}
    x, y = view.origin
    ends = view.along(low[view.up]) - 4.0, view.along(high[view.up]) + 4.0
    axes.plot([x, x], ends, **chain)
    beyond = view.across(low[X]) - 4.0, view.across(high[X]) + 4.0
    axes.plot(beyond, [y, y], **(chain if view.up == Y else {"color": DARK, "lw": MEDIUM}))
    mark_point(axes, (x, y), DARK)
    if plan.centre_mm is not None:
        x, y = view.place(plan.centre_mm[None])[0].tolist()
        mark_point(axes, (x, y), VERMILLION)


def _fill(axes: Axes, view: View, points: Array, look: Mapping[str, Any]) -> None:
    axes.fill(*convex_hull(view.place(points)).T, lw=THIN, zorder=1.5, **look)


def _draw_beam(axes: Axes, sensor: PlacedSensor, view: View) -> None:
    """Draw the direction of a sensor, and its field of view as seen from above."""
    start = view.place(sensor.place_mm[None])[0]
    step = sensor.direction[[view.right, view.up]] * ARROW
    if view.up == Y and sensor.fov_deg is not None and sensor.fov_deg < 360.0:
        half = sensor.fov_deg / 2
        bounds = sensor.yaw_deg - half, sensor.yaw_deg + half
        axes.add_patch(Wedge(start, _FAN, *bounds, fc=BLUE, ec="none", alpha=0.18, zorder=2.5))
    arrow = {"arrowstyle": "-|>,head_width=0.12,head_length=0.25", "color": BLUE, "lw": MEDIUM}
    axes.annotate("", start + step, start, arrowprops={**arrow, "shrinkA": 0, "shrinkB": 0})
    axes.plot(*start, ".", color="black", ms=2.2, zorder=4)
