"""Technical drawings: pages in millimetres, scaled views, ordinate dimensions."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.optimize import isotonic_regression

from evoros.base.arrays import Array

INCH_MM = 25.4
SMALL_PT, TEXT_PT, TITLE_PT = 6.0, 7.0, 9.0
THIN, MEDIUM = 0.35, 0.7  # line widths [pt]
GREY, DARK = "0.45", "0.15"
LABEL_MM = 2.9  # minimum distance [mm] between two lines of labels
_STEPS = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)  # scales 1:N, times a power of ten
_BARS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)  # lengths [mm] of the scale bar


def choose_scale(length_mm: float, room_mm: float) -> float:
    """Return the smallest N of the common scales 1:N at which a length fits."""
    power = 0.01
    while True:
        for step in _STEPS:
            if length_mm <= room_mm * step * power * (1.0 + 1e-9):
                return step * power
        power *= 10.0


def make_page(width_mm: float, height_mm: float) -> tuple[Figure, Axes]:
    """Make an empty page with axes in millimetres from the lower left corner."""
    figure = Figure(figsize=(width_mm / INCH_MM, height_mm / INCH_MM))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, width_mm), ylim=(0.0, height_mm))
    axes.set_axis_off()
    return figure, axes


@dataclass(frozen=True)
class View:
    """A view along an axis of the robot; the other two axes are in the page."""

    right: int  # index of the robot's axis that points right
    up: int
    scale: float  # ratio of robot to page dimensions
    origin: tuple[float, float]  # position [mm] of the robot's origin on the page

    def place(self, points: Array) -> Array:
        """Return the positions (n, 2) [mm] on the page of points (n, 3) [mm] on the robot."""
        placed: Array = points[:, [self.right, self.up]] / self.scale + np.array(self.origin)
        return placed

    def across(self, value: float) -> float:
        """Return the page coordinate [mm] of a value on the axis that points right."""
        return value / self.scale + self.origin[0]

    def along(self, value: float) -> float:
        """Return the page coordinate [mm] of a value on the axis that points up."""
        return value / self.scale + self.origin[1]


def spread(places: Sequence[float], minimum: float) -> list[float]:
    """Shift increasing positions as little as possible to be at least ``minimum`` apart."""
    if np.all(np.diff(places) >= minimum):
        return list(places)
    gaps = np.array(places) - minimum * np.arange(len(places))
    moved: list[float] = (np.array(places) + (isotonic_regression(gaps).x - gaps)).tolist()
    return moved


def label_sensors(axes: Axes, sensors: pd.DataFrame, aside: float, apart: float) -> None:
    """Write each sensor's ``label`` (bold if ``bold``) next to the robot, with a leader line."""
    for side in (1.0, -1.0):
        chosen = sensors[(sensors["y_m"] >= 0.0) == (side > 0.0)].sort_values("x_m")
        levels = spread(chosen["x_m"].tolist(), apart)
        for row, level in zip(chosen.to_dict("records"), levels, strict=True):
            end, weight = side * aside, "bold" if row["bold"] else "normal"
            axes.plot([row["y_m"], end], [row["x_m"], level], color="0.3", lw=0.4, zorder=3)
            look: dict[str, Any] = {"fontsize": "small", "va": "center", "zorder": 5}
            ha = "right" if side > 0 else "left"
            axes.text(end, level, f" {row['label']} ", ha=ha, weight=weight, **look)


def group_values(pairs: Iterable[tuple[float, float]]) -> dict[float, list[float]]:
    """Group dimension lines by rounded value; ``pairs`` are (value, start of the line)."""
    groups: dict[float, list[float]] = {}
    for value, begin in pairs:
        groups.setdefault(round(value, 1) + 0.0, []).append(begin)
    return dict(sorted(groups.items()))


class Rail(NamedTuple):
    """The line along which the dimensions of one axis are written."""

    place: Callable[[float], float]  # converts a value to a page coordinate
    end: float  # end of the leader lines, across the axis
    upright: bool  # whether lines are vertical and labels rotated


def write_ordinates(
    axes: Axes, values: Mapping[float, Sequence[float]], rail: Rail, colour: str = DARK
) -> None:
    """Write the values of an axis on a rail, with lines from the measured points."""
    place, end, upright = rail
    levels = spread([place(value) for value in values], LABEL_MM)
    for (value, begins), level in zip(values.items(), levels, strict=True):
        away = 1.0 if end > max(begins) else -1.0
        begin = max(begins) if away > 0 else min(begins)
        line = [(begin, place(value)), (end - 5.0 * away, place(value)), (end - 2.0 * away, level)]
        line.append((end, level))
        along, across = np.array(line).T
        axes.plot(*((across, along) if upright else (along, across)), color=GREY, lw=THIN)
        far = end + 0.7 * away
        x, y = (level, far) if upright else (far, level)
        text, ha = f"{value:g}".replace("-", "\N{MINUS SIGN}"), "left" if away > 0 else "right"
        turn: dict[str, Any] = {"rotation": 90 if upright else 0, "rotation_mode": "anchor"}
        axes.text(x, y, text, fontsize=SMALL_PT, color=colour, ha=ha, va="center", **turn)


def draw_scale_bar(axes: Axes, corner: tuple[float, float], scale: float) -> None:
    """Draw a scale bar for a round length [mm] of the robot, labelled with length and scale."""
    length = max(v for v in _BARS if v / scale <= 40.0 or v == 1)
    x, y = corner
    for part in range(4):
        ends = [x + part * length / scale / 4, x + (part + 1) * length / scale / 4]
        axes.fill_between(ends, y, y + 1.2, fc="white" if part % 2 else DARK, ec=DARK, lw=THIN)
    style: dict[str, Any] = {"fontsize": SMALL_PT, "va": "top", "color": DARK}
    axes.text(x, y - 0.8, "0", ha="center", **style)
    axes.text(x + length / scale, y - 0.8, f"{length} mm", ha="center", **style)
    where = (x + length / scale + 3.0, y + 0.6)
    axes.text(*where, f"scale 1:{scale:g}, printed at 100 %", fontsize=SMALL_PT, va="center")


def separate(boxes: Array, size: tuple[float, float], rounds: int = 200) -> Array:
    """Shift the centres (n, 2) of equal boxes until no two boxes overlap."""
    moved = boxes.astype(np.float64).copy()
    wanted = np.array(size)
    for _ in range(rounds):
        done = True
        for i in range(len(moved)):
            for j in range(i):
                gap = moved[i] - moved[j]
                room = wanted - np.abs(gap)
                if room.min() > 1e-6:
                    done = False
                    axis = int(np.argmin(room))
                    side = 1.0 if gap[axis] >= 0.0 else -1.0
                    moved[i, axis] += side * (room[axis] / 2 + 1e-3)
                    moved[j, axis] -= side * (room[axis] / 2 + 1e-3)
        if done:
            break
    return moved
