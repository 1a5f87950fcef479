"""The dimensions, labels, notes and table in a drawing of a robot's mounts."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Wedge

from .mounting_plan import MountingPlan, X, Y, Z
from .paper import (
    DARK,
    GREY,
    MEDIUM,
    SMALL_PT,
    TEXT_PT,
    THIN,
    Rail,
    View,
    group_values,
    separate,
    write_ordinates,
)
from .style import BLUE, VERMILLION

LINE = 3.9  # height of a line of the table and the notes [mm]
ARROW = 11.0  # length of the arrow of a sensor on the page [mm]
_LABEL = 19.0  # distance of a label from its sensor [mm]
_BALLOON, _ANGLE = 3.9, 11.0  # width of a number and of an angle [mm]
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


def mark_point(axes: Axes, place: tuple[float, float], colour: str) -> None:
    """Draw the quartered circle that marks a point of reference."""
    axes.add_patch(Circle(place, 1.5, fc="white", ec=colour, lw=MEDIUM, zorder=5))
    for turn in (0, 180):
        axes.add_patch(Wedge(place, 1.5, turn, turn + 90, fc=colour, ec="none", zorder=5.1))


def dimension_above(axes: Axes, plan: MountingPlan, view: View, top: float) -> None:
    """Write x over the view, and y on its right; each value once."""
    places = [sensor.place_mm for sensor in plan.sensors]
    xs = group_values((p[X], view.along(p[Y])) for p in places)
    ys = group_values((p[Y], view.across(p[X])) for p in places)
    xs.setdefault(0.0, [view.origin[1]])
    ys.setdefault(0.0, [view.across(plan.bounds[1][X]) + 4.0])
    write_ordinates(axes, dict(sorted(xs.items())), Rail(view.across, top, True))
    end = view.across(plan.bounds[1][X]) + 33.0
    write_ordinates(axes, dict(sorted(ys.items())), Rail(view.along, end, False))
    caption: dict[str, Any] = {"fontsize": TEXT_PT, "color": GREY, "va": "center"}
    axes.text(4.0, top + 2.0, "from above: x ahead", **caption)
    axes.text(end, view.along(plan.bounds[1][Y]) + 9.0, "y to the left", ha="center", **caption)


def dimension_side(axes: Axes, plan: MountingPlan, view: View) -> None:
    """Write z on the right of the view, and below it x of what helps to find the datum."""
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
    axes.text(4.0, view.along(high[Z]) + 16.0, "from the right: x ahead, z up", **caption)


def label_above(axes: Axes, plan: MountingPlan, view: View) -> None:
    """Write number and yaw of each sensor beyond its arrow."""
    if not plan.sensors:
        return
    starts = view.place(np.array([sensor.place_mm for sensor in plan.sensors]))
    steps = np.array([sensor.direction[:2] for sensor in plan.sensors]) * _LABEL
    moved = separate(starts + steps, (_BALLOON + _ANGLE + 1.0, _BALLOON + 0.4))
    tips = starts + steps * (ARROW / _LABEL)
    for index, (sensor, tip, place) in enumerate(zip(plan.sensors, tips, moved, strict=True)):
        disc = place[0] - _ANGLE / 2, place[1]
        axes.plot([tip[0], disc[0]], [tip[1], disc[1]], color=BLUE, lw=THIN, zorder=5.5)
        _write_label(axes, place.tolist(), [index], write_angle(sensor.yaw_deg, "L", "R"))


def label_side(axes: Axes, plan: MountingPlan, view: View) -> None:
    """Write numbers and pitch over the view; sensors that look alike from the right share these."""
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
        _write_label(axes, label, numbers, write_angle(key[2], "up", "down"))


def _write_label(axes: Axes, place: Sequence[float], numbers: Sequence[int], angle: str) -> None:
    """Write numbers in discs and an angle, both centred at a place."""
    middle, y = place
    left = middle - (len(numbers) * _BALLOON + _ANGLE) / 2
    for position, index in enumerate(numbers):
        x = left + (position + 0.5) * _BALLOON
        axes.add_patch(Circle((x, y), _BALLOON / 2 - 0.1, fc=BLUE, ec="white", lw=THIN, zorder=6))
        style: dict[str, Any] = {"fontsize": SMALL_PT, "va": "center", "zorder": 7}
        axes.text(x, y, str(index), color="white", weight="bold", ha="center", **style)
    box = {"boxstyle": "square,pad=0.12", "fc": "white", "ec": "none", "alpha": 0.8}
    axes.text(left + len(numbers) * _BALLOON + 0.8, y, angle, bbox=box, **style)


def write_length(value: float) -> str:
    """Return a length with one decimal and a sign of typographic width."""
    return f"{round(value, 1) + 0.0:.1f}".replace("-", "\N{MINUS SIGN}")


def write_angle(degrees: float, positive: str, negative: str) -> str:
    """Return an angle without sign, and the word for its side."""
    size = f"{abs(degrees):.1f}\N{DEGREE SIGN}"
    return size if not round(degrees, 1) else f"{size} {positive if degrees > 0 else negative}"


def list_notes(plan: MountingPlan) -> Iterator[tuple[str, str]]:
    """Yield the colour of the mark of each point of reference, and what it is."""
    yield DARK, f"datum of all dimensions: {plan.datum}"
    if plan.centre_mm is not None:
        place = ", ".join(map(write_length, plan.centre_mm.tolist()))
        yield VERMILLION, f"centre of mass of the description: {place} mm"


def write_table(
    axes: Axes, plan: MountingPlan, notes: Sequence[tuple[str, str]], top: float
) -> None:
    """Write the notes, and below them a row for each sensor, from a height on the page down."""
    for line, (colour, note) in enumerate(notes):
        y = top - LINE * (line + 0.5)
        mark_point(axes, (6.0, y), colour)
        axes.text(9.0, y, note, fontsize=TEXT_PT, va="center")
    top -= LINE * (len(notes) + 0.5)
    rows = [tuple(head for head, _, _ in _COLUMNS)]
    for index, sensor in enumerate(plan.sensors):
        yaw = write_angle(sensor.yaw_deg, "left", "right")
        pitch = write_angle(sensor.pitch_deg, "up", "down")
        where = map(write_length, sensor.place_mm.tolist())
        seen = "none" if sensor.fov_deg is None else f"{sensor.fov_deg:g}\N{DEGREE SIGN}"
        rows.append((str(index), sensor.name, *where, yaw, pitch, seen, sensor.reach))
    for line, row in enumerate(rows):
        y = top - LINE * (line + 0.5)
        weight = "bold" if line == 0 else "normal"
        for (_, x, side), cell in zip(_COLUMNS, row, strict=True):
            axes.text(4.0 + x, y, cell, fontsize=TEXT_PT, ha=side, va="center", weight=weight)
        axes.plot([4.0, 4.0 + 170.0], [y - LINE / 2] * 2, color=GREY, lw=THIN)
