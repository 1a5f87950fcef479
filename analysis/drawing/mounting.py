"""A drawing for mounting a robot's sensors: top view, view from the right, and table."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Wedge

from evoros.base.arrays import Array
from evoros.geometry.footprint import convex_hull

from .paper import (
    DARK,
    GREY,
    INCH_MM,
    MEDIUM,
    SMALL_PT,
    TEXT_PT,
    THIN,
    TITLE_PT,
    Rail,
    View,
    choose_scale,
    draw_scale_bar,
    group_values,
    make_page,
    separate,
    write_ordinates,
)
from .style import BLUE, PAGE_IN, VERMILLION, use_style

X, Y, Z = range(3)


@dataclass(frozen=True, eq=False)
class Solid:
    """A convex part of the robot."""

    points_mm: Array  # (n, 3)
    wheel: bool


@dataclass(frozen=True, eq=False)
class PlacedSensor:
    """A sensor in the robot's frame: x forward, y left, z up from the ground."""

    name: str
    place_mm: Array  # (3,)
    yaw_deg: float  # left is positive
    pitch_deg: float  # positive if the nose points up
    fov_deg: float | None  # None if the sensor casts no rays
    reach: str  # description of the range, or of a bumper's contact zone
    corners_mm: Array  # (n, 3) corners of the sensor body; empty if it has no size

    @property
    def direction(self) -> Array:
        """The unit vector (3,) along the beam."""
        yaw, pitch = np.radians(self.yaw_deg), np.radians(self.pitch_deg)
        ahead = np.cos(pitch)
        direction: Array = np.array([ahead * np.cos(yaw), ahead * np.sin(yaw), np.sin(pitch)])
        return direction


@dataclass(frozen=True, eq=False)
class MountingPlan:
    """The content of a drawing; dimensions are measured from the robot's origin, the datum."""

    title: str
    source: str
    datum: str  # description of the origin
    solids: Sequence[Solid]
    sensors: Sequence[PlacedSensor]
    centre_mm: Array | None  # (3,) centre of mass
    axles_mm: Sequence[float]  # x of each wheel axis

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """The minimum and maximum corner (3,) of the box around the robot and the datum."""
        parts = [solid.points_mm for solid in self.solids]
        points = np.concatenate([np.zeros((1, 3)), *parts, *[s.corners_mm for s in self.sensors]])
        places = np.array([sensor.place_mm for sensor in self.sensors]).reshape(-1, 3)
        points = np.concatenate([points, places])
        return points.min(axis=0), points.max(axis=0)


LINE = 3.9  # line height [mm] of the table and the notes
_ARROW = 11.0  # length [mm] of a sensor's arrow on the page
_LABEL = 19.0  # distance [mm] of a label from its sensor
_BALLOON, _ANGLE = 3.9, 11.0  # diameter [mm] of a number's circle, and width of an angle
_COLUMNS = (
    ("", 3.0, "center"),
    ("frame", 8.0, "left"),
    ("x [mm]", 50.0, "right"),
    ("y [mm]", 66.0, "right"),
    ("z [mm]", 82.0, "right"),
    ("yaw", 104.0, "right"),
    ("pitch", 123.0, "right"),
    ("field of view", 145.0, "right"),
    ("range", 169.0, "right"),
)


def _mark_point(axes: Axes, place: tuple[float, float], colour: str) -> None:
    axes.add_patch(Circle(place, 1.5, fc="white", ec=colour, lw=MEDIUM, zorder=5))
    for turn in (0, 180):
        axes.add_patch(Wedge(place, 1.5, turn, turn + 90, fc=colour, ec="none", zorder=5.1))


def _dimension_above(axes: Axes, plan: MountingPlan, view: View, top: float) -> None:
    places = [sensor.place_mm for sensor in plan.sensors]
    xs = group_values((p[X], view.along(p[Y])) for p in places)
    ys = group_values((p[Y], view.across(p[X])) for p in places)
    xs.setdefault(0.0, [view.origin[1]])
    ys.setdefault(0.0, [view.across(plan.bounds[1][X]) + 4.0])
    write_ordinates(axes, dict(sorted(xs.items())), Rail(view.across, top, True))
    end = view.across(plan.bounds[1][X]) + 33.0
    write_ordinates(axes, dict(sorted(ys.items())), Rail(view.along, end, False))
    caption: dict[str, Any] = {"fontsize": TEXT_PT, "color": GREY, "va": "center"}
    axes.text(4.0, top + 2.0, "top view: x forward", **caption)
    axes.text(end, view.along(plan.bounds[1][Y]) + 9.0, "y to the left", ha="center", **caption)


def _dimension_side(axes: Axes, plan: MountingPlan, view: View) -> None:
    low, high = plan.bounds
    zs = group_values((s.place_mm[Z], view.across(s.place_mm[X])) for s in plan.sensors)
    zs.setdefault(0.0, [view.across(high[X]) + 4.0])
    end = view.across(high[X]) + 33.0
    write_ordinates(axes, dict(sorted(zs.items())), Rail(view.along, end, False))
    ground = view.along(0.0)
    body = np.concatenate([s.points_mm for s in plan.solids] or [np.zeros((1, 3))])
    marks = [*plan.axles_mm, body[:, X].min(), body[:, X].max(), 0.0]
    bottom = view.along(low[Z]) - 9.0
    xs = group_values((float(x), ground) for x in marks)
    write_ordinates(axes, xs, Rail(view.across, bottom, True), GREY)
    caption: dict[str, Any] = {"fontsize": TEXT_PT, "color": GREY, "va": "center"}
    axes.text(view.across(high[X]) + 5.0, bottom - 3.0, "x of axles and ends", **caption)
    axes.text(4.0, view.along(high[Z]) + 16.0, "right-hand view: x forward, z up", **caption)


def _label_above(axes: Axes, plan: MountingPlan, view: View) -> None:
    if not plan.sensors:
        return
    starts = view.place(np.array([sensor.place_mm for sensor in plan.sensors]))
    steps = np.array([sensor.direction[:2] for sensor in plan.sensors]) * _LABEL
    moved = separate(starts + steps, (_BALLOON + _ANGLE + 1.0, _BALLOON + 0.4))
    tips = starts + steps * (_ARROW / _LABEL)
    for index, (sensor, tip, place) in enumerate(zip(plan.sensors, tips, moved, strict=True)):
        disc = place[0] - _ANGLE / 2, place[1]
        axes.plot([tip[0], disc[0]], [tip[1], disc[1]], color=BLUE, lw=THIN, zorder=5.5)
        _write_label(axes, place.tolist(), [index], _write_angle(sensor.yaw_deg, "L", "R"))


def _label_side(axes: Axes, plan: MountingPlan, view: View) -> None:
    alike: dict[tuple[float, ...], list[int]] = {}
    for index, sensor in enumerate(plan.sensors):
        key = (*sensor.place_mm[[X, Z]].round(1).tolist(), round(sensor.pitch_deg, 1))
        alike.setdefault(key, []).append(index)
    if not alike:
        return
    places = view.place(np.array([[x, 0.0, z] for x, z, _ in alike]))
    top = view.along(plan.bounds[1][Z]) + 8.0
    width = max(map(len, alike.values())) * _BALLOON + _ANGLE + 3.0
    moved = separate(
        np.stack([places[:, 0], np.full(len(places), top)], 1), (width, _BALLOON + 0.4)
    )
    for (key, numbers), start, label in zip(alike.items(), places, moved.tolist(), strict=True):
        axes.plot([start[0], label[0]], [start[1], label[1]], color=BLUE, lw=THIN, zorder=5.5)
        _write_label(axes, label, numbers, _write_angle(key[2], "up", "down"))


def _write_label(axes: Axes, place: Sequence[float], numbers: Sequence[int], angle: str) -> None:
    middle, y = place
    left = middle - (len(numbers) * _BALLOON + _ANGLE) / 2
    for position, index in enumerate(numbers):
        x = left + (position + 0.5) * _BALLOON
        axes.add_patch(Circle((x, y), _BALLOON / 2 - 0.1, fc=BLUE, ec="white", lw=THIN, zorder=6))
        style: dict[str, Any] = {"fontsize": SMALL_PT, "va": "center", "zorder": 7}
        axes.text(x, y, str(index), color="white", weight="bold", ha="center", **style)
    box = {"boxstyle": "square,pad=0.12", "fc": "white", "ec": "none", "alpha": 0.8}
    axes.text(left + len(numbers) * _BALLOON + 0.8, y, angle, bbox=box, **style)


def _write_length(value: float) -> str:
    return f"{round(value, 1) + 0.0:.1f}".replace("-", "\N{MINUS SIGN}")


def _write_angle(degrees: float, positive: str, negative: str) -> str:
    size = f"{abs(degrees):.1f}\N{DEGREE SIGN}"
    return size if not round(degrees, 1) else f"{size} {positive if degrees > 0 else negative}"


def _list_notes(plan: MountingPlan) -> Iterator[tuple[str, str]]:
    yield DARK, f"datum of all dimensions: {plan.datum}"
    if plan.centre_mm is not None:
        place = ", ".join(map(_write_length, plan.centre_mm.tolist()))
        yield VERMILLION, f"centre of mass according to the description: {place} mm"


def write_table(
    axes: Axes, plan: MountingPlan, notes: Sequence[tuple[str, str]], top: float
) -> None:
    """Write the notes downwards from ``top``, followed by one row per sensor."""
    for line, (colour, note) in enumerate(notes):
        y = top - LINE * (line + 0.5)
        _mark_point(axes, (6.0, y), colour)
        axes.text(9.0, y, note, fontsize=TEXT_PT, va="center")
    top -= LINE * (len(notes) + 0.5)
    rows = [tuple(head for head, _, _ in _COLUMNS)]
    for index, sensor in enumerate(plan.sensors):
        yaw = _write_angle(sensor.yaw_deg, "left", "right")
        pitch = _write_angle(sensor.pitch_deg, "up", "down")
        where = map(_write_length, sensor.place_mm.tolist())
        seen = "none" if sensor.fov_deg is None else f"{sensor.fov_deg:g}\N{DEGREE SIGN}"
        rows.append((str(index), sensor.name, *where, yaw, pitch, seen, sensor.reach))
    for line, row in enumerate(rows):
        y = top - LINE * (line + 0.5)
        weight = "bold" if line == 0 else "normal"
        for (_, x, side), cell in zip(_COLUMNS, row, strict=True):
            axes.text(4.0 + x, y, cell, fontsize=TEXT_PT, ha=side, va="center", weight=weight)
        axes.plot([4.0, 4.0 + 170.0], [y - LINE / 2] * 2, color=GREY, lw=THIN)


_BODY, _WHEEL = "0.9", "0.72"
_LEFT, _RIGHT = 16.0, 42.0  # margins [mm] left and right of the views
_ABOVE, _BETWEEN, _BELOW = 38.0, 40.0, 17.0  # space [mm] above, between and below the views
_TALL, _MINIMUM = 280.0, 60.0  # maximum page height, and minimum height of both views [mm]
_FAN = 9.0  # length [mm] of a field of view on the page


def draw_mounting(plan: MountingPlan) -> Figure:
    """Draw a plan to scale on a page of two columns."""
    width = PAGE_IN * INCH_MM
    low, high = plan.bounds
    notes = list(_list_notes(plan))
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
        _dimension_above(axes, plan, above, height - 20.0)
        _dimension_side(axes, plan, side)
        _label_above(axes, plan, above)
        _label_side(axes, plan, side)
        draw_scale_bar(axes, (6.0, footer - 8.0), scale)
        write_table(axes, plan, notes, footer - 13.0)
    return figure


def _draw_view(axes: Axes, plan: MountingPlan, view: View) -> None:
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
    _mark_point(axes, (x, y), DARK)
    if plan.centre_mm is not None:
        x, y = view.place(plan.centre_mm[None])[0].tolist()
        _mark_point(axes, (x, y), VERMILLION)


def _fill(axes: Axes, view: View, points: Array, look: Mapping[str, Any]) -> None:
    axes.fill(*convex_hull(view.place(points)).T, lw=THIN, zorder=1.5, **look)


def _draw_beam(axes: Axes, sensor: PlacedSensor, view: View) -> None:
    start = view.place(sensor.place_mm[None])[0]
    step = sensor.direction[[view.right, view.up]] * _ARROW
    if view.up == Y and sensor.fov_deg is not None and sensor.fov_deg < 360.0:
        half = sensor.fov_deg / 2
        bounds = sensor.yaw_deg - half, sensor.yaw_deg + half
        axes.add_patch(Wedge(start, _FAN, *bounds, fc=BLUE, ec="none", alpha=0.18, zorder=2.5))
    arrow = {"arrowstyle": "-|>,head_width=0.12,head_length=0.25", "color": BLUE, "lw": MEDIUM}
    axes.annotate("", start + step, start, arrowprops={**arrow, "shrinkA": 0, "shrinkB": 0})
    axes.plot(*start, ".", color="black", ms=2.2, zorder=4)
