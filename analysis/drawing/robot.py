"""Top view of a robot with the sensors and cones of one or more designs; forward is up."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from evoros.base.arrays import Array
from evoros.sensor.protocol import CONTACT, MOTION, WHEELS
from evoros.storage.figure_context import FigureContext

from ..designs.cones import Window, outline_part, trace_cones, trace_zone
from ..tables.champions import BEST_SO_FAR
from ..tables.designs import SIGNAL_COLUMNS
from ..tables.treatments import SINGLE
from .style import PURPLE, VERMILLION

MARKERS = "os^DvP"  # one marker per sensor type
AXES = ("y, left [m]", "x, forward [m]")
_BODY, _WHEEL = "0.88", "0.45"
_EDGE = "0.35"
RAY = VERMILLION
LINE_DEG = 2.0  # field of view [deg] below which a beam is drawn as a line
_HEADING_IN, _RAY_PT = 0.075, 1.2  # length of a heading line, and width of a ray


def aspect_ratio(view: Window) -> float:
    """Return the height of a window on the page divided by its width."""
    x_low, x_high, y_low, y_high = view
    return (x_high - x_low) / (y_high - y_low)


def to_page(points: Array) -> Array:
    """Convert points (n, 2) from the robot's frame to the page: y across, x up."""
    return points[:, ::-1]


def frame_axes(axes: Axes, view: Window) -> None:
    """Fit axes to a window at equal scales; x (forward) points up, y (left) to the left."""
    x_low, x_high, y_low, y_high = view
    axes.set(xlim=(y_high, y_low), ylim=(x_low, x_high), aspect="equal")
    axes.tick_params(length=2, pad=2, labelsize="small")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MaxNLocator(4))
        axis.set_major_formatter("{x:g}")


def draw_robot(axes: Axes, context: FigureContext, alpha: float = 0.85, order: float = 1) -> None:
    """Draw the parts of a robot from bottom to top, with opacity ``alpha``."""
    for part in sorted(context.parts, key=lambda part: part.top_m):
        look: dict[str, Any] = {"fc": _WHEEL if part.wheel else _BODY, "ec": _EDGE, "lw": 0.4}
        axes.fill(*to_page(outline_part(part)).T, alpha=alpha, zorder=order, **look)


def draw_cones(
    axes: Axes, sensors: pd.DataFrame, colours: Sequence[str], reach_m: float = math.inf
) -> PolyCollection:
    """Draw each cone in its colour, cut off at ``reach_m``; return the collection of cones."""
    cones = [to_page(cone) for cone in trace_cones(sensors, reach_m)]
    areas = PolyCollection(cones, facecolors=list(colours), alpha=0.4, linewidths=0.0, zorder=2.0)
    edges = PolyCollection(
        cones, facecolors="none", edgecolors=list(colours), linewidths=0.5, zorder=2.1
    )
    axes.add_collection(areas, autolim=False)
    axes.add_collection(edges, autolim=False)
    draw_rays(axes, sensors, colours, reach_m)
    return areas


def draw_rays(
    axes: Axes,
    sensors: pd.DataFrame,
    colours: Sequence[str],
    reach_m: float = math.inf,
    alpha: float = 1.0,
) -> None:
    """Draw each narrow beam or single ray as a line with a dot at the end."""
    narrow = (sensors["fov_deg"] < LINE_DEG).to_numpy()
    rows = sensors.loc[narrow, ["x_m", "y_m", "yaw_deg", "range_m"]].to_numpy(dtype=np.float64)
    if not len(rows):
        return
    begins, yaw, reach = rows[:, :2], np.radians(rows[:, 2]), np.minimum(rows[:, 3], reach_m)
    ends = begins + reach[:, None] * np.column_stack([np.cos(yaw), np.sin(yaw)])
    chosen = [colour for colour, is_narrow in zip(colours, narrow, strict=True) if is_narrow]
    lines = np.stack([to_page(begins), to_page(ends)], axis=1)
    style: dict[str, Any] = {"alpha": alpha, "zorder": 2.2}
    axes.add_collection(
        LineCollection(list(lines), colors=chosen, linewidths=_RAY_PT, **style), autolim=False
    )
    axes.scatter(ends[:, 1], ends[:, 0], s=7, c=chosen, linewidths=0, **style)


def draw_sensors(
    axes: Axes,
    sensors: pd.DataFrame,
    colours: Sequence[str],
    markers: Mapping[str, str],
    look: tuple[float, float] = (3.0, 1.0),
) -> None:
    """Draw each sensor with the marker of its type; ``look`` is marker size [pt] and opacity."""
    size_pt, alpha = look
    for kind, marker in markers.items():
        chosen = (sensors["type"] == kind).to_numpy()
        places = to_page(sensors.loc[chosen, ["x_m", "y_m"]].to_numpy(dtype=np.float64))
        faces = [colour for colour, is_kind in zip(colours, chosen, strict=True) if is_kind]
        style: dict[str, Any] = {"marker": marker, "edgecolors": "black", "linewidths": 0.4}
        x, y = places.T
        axes.scatter(x, y, s=size_pt**2, c=faces, alpha=alpha, zorder=4.0, **style)
    _draw_headings(axes, sensors, alpha)


def _draw_headings(axes: Axes, sensors: pd.DataFrame, alpha: float) -> None:
    places = to_page(sensors[["x_m", "y_m"]].to_numpy(dtype=np.float64))
    yaw = np.radians(sensors["yaw_deg"].to_numpy(dtype=np.float64))
    # angles refer to the page, not to the data
    units = {"angles": "uv", "units": "inches", "scale_units": "inches"}
    sizes = {"scale": 1.0 / _HEADING_IN, "width": 0.011, "headwidth": 1.0, "headlength": 0.0}
    look: dict[str, Any] = {**units, **sizes, "headaxislength": 0.0, "color": "black"}
    axes.quiver(*places.T, -np.sin(yaw), np.cos(yaw), alpha=alpha, zorder=4.1, **look)


def _make_place_handles(sensors: pd.DataFrame) -> list[Line2D]:
    if sensors.empty:
        return []
    dot = Line2D([], [], marker="o", ms=3, lw=1.0, color="black", label="sensor and heading")
    ray = Line2D([], [], marker="o", ms=2.5, lw=_RAY_PT, color=RAY, label="single ray")
    return [dot, ray] if (sensors["fov_deg"] < LINE_DEG).any() else [dot]


def assign_markers(sensors: pd.DataFrame) -> dict[str, str]:
    """Assign a marker to each sensor type."""
    kinds = sorted(sensors["type"].unique())
    return {kind: MARKERS[i % len(MARKERS)] for i, kind in enumerate(kinds)}


def _make_type_handles(markers: Mapping[str, str]) -> list[Line2D]:
    if len(markers) < 2:
        return []
    return [
        Line2D([], [], ls="none", marker=marker, mfc="none", mec="black", ms=4, label=kind)
        for kind, marker in markers.items()
    ]


_MARKERS = {WHEELS: ("p", 6.5), MOTION: ("X", 4.0), CONTACT: ("*", 4.0)}  # marker and its size [pt]
_HATCH = "/////"


@dataclass(frozen=True, eq=False)
class Champions:
    """Champions and their sensors; a champion without sensors has one row without a position."""

    sensors: pd.DataFrame
    contexts: Mapping[str, FigureContext]  # one per treatment
    signals: pd.DataFrame | None = None  # sensors without rays; see ``Study.signals``
    unfinished: Collection[str] = ()  # runs represented by their current best design

    @cached_property
    def placed(self) -> pd.DataFrame:
        """The rows with a sensor."""
        return self.sensors.dropna(subset="x_m")

    @cached_property
    def others(self) -> pd.DataFrame:
        """The sensors without rays."""
        return pd.DataFrame(columns=SIGNAL_COLUMNS) if self.signals is None else self.signals

    @cached_property
    def markers(self) -> dict[str, str]:
        """The marker of each sensor type."""
        return assign_markers(self.placed)

    @cached_property
    def numbers(self) -> "pd.Series[int]":
        """The number of champions per treatment."""
        return self.sensors.groupby("treatment").run.nunique()

    @property
    def several(self) -> bool:
        """True if any treatment has several champions."""
        return int(self.numbers.max()) > 1

    def make_handles(self, with_rays: bool = True) -> list[Line2D | Patch]:
        """Make the legend entries for sensors, rays and sensor types."""
        places = _make_place_handles(self.placed)
        types = _make_type_handles(self.markers)
        return [*places[: None if with_rays else 1], *types, *_make_signal_handles(self.others)]

    def draw_on_each_other(self, axes: Axes, treatment: str, cut_m: float, places: bool) -> None:
        """Draw the rays of a treatment's champions and, if ``places``, their sensors."""
        chosen = self.placed[self.placed.treatment == treatment]
        alpha = 0.35 if self.several else 0.8  # overlapping dots look darker
        draw_rays(axes, chosen, [RAY] * len(chosen), cut_m, alpha)
        if places:
            draw_sensors(axes, chosen, ["black"] * len(chosen), self.markers, (2.5, alpha))
            if len(self.others):
                signals = self.others[self.others.treatment == treatment]
                draw_signals(axes, signals, self.contexts[treatment], alpha)

    def describe(self, treatment: str) -> str:
        """Describe a treatment; the fitness of a single champion follows on a separate line."""
        head = self._count(treatment)
        head = head if treatment == SINGLE else f"{treatment} ({head})"
        if self.several or "fitness_low" not in self.sensors:
            return head
        rows = self.sensors[self.sensors.treatment == treatment].dropna(subset="fitness_low")
        if rows.empty:
            return head
        value, low, high = rows.iloc[0][["validated_fitness", "fitness_low", "fitness_high"]]
        return f"{head}\nvalidated {value:.2f} [{low:.2f}, {high:.2f}]"

    def _count(self, treatment: str) -> str:
        runs = self.sensors[self.sensors.treatment == treatment].run.unique()
        unfinished = sum(run in self.unfinished for run in runs)
        champions = len(runs) - unfinished
        if champions == 0:
            return BEST_SO_FAR if unfinished == 1 else f"{unfinished} runs, {BEST_SO_FAR}"
        count = f"{champions} champion" + "s" * (champions > 1)
        return f"{count}, {unfinished} {BEST_SO_FAR}" if unfinished else count


def draw_signals(
    axes: Axes, signals: pd.DataFrame, context: FigureContext, alpha: float = 1.0
) -> None:
    """Draw each sensor without rays: its position, or its contact zone up to the robot's edge."""
    columns = ["x_m", "y_m", "yaw_deg", "width_m", "depth_m"]
    bumpers = signals.loc[signals["width_m"] > 0.0, columns].to_numpy(float).tolist()
    zones = [
        to_page(trace_zone((x, y), yaw, width, depth, context))
        for x, y, yaw, width, depth in bumpers
    ]
    look: dict[str, Any] = {"facecolors": "none", "edgecolors": PURPLE, "linewidths": 0.6}
    drawn = PolyCollection(zones, hatch=_HATCH, alpha=alpha, zorder=3.5, **look)
    axes.add_collection(drawn, autolim=False)
    for order, measures in enumerate(_MARKERS):  # draw smaller markers on top
        shown = (signals["measures"] == measures) & (signals["width_m"] <= 0.0)
        places = to_page(signals.loc[shown, ["x_m", "y_m"]].to_numpy(float))
        axes.plot(*places.T, **_style(measures), alpha=alpha, zorder=4.5 + 0.01 * order)


def _make_signal_handles(signals: pd.DataFrame) -> list[Line2D | Patch]:
    kinds = signals.drop_duplicates("type")
    return [
        Patch(fc="none", ec=PURPLE, hatch=_HATCH, lw=0.6, label=f"{kind} (zone)")
        if width > 0.0
        else Line2D([], [], label=str(kind), **_style(str(measures)))
        for kind, measures, width in zip(
            kinds["type"], kinds["measures"], kinds["width_m"], strict=True
        )
    ]


def _style(measures: str) -> dict[str, Any]:
    marker, size = _MARKERS[measures]
    looks = {"mfc": "white", "mec": "black", "mew": 0.6, "ms": size}
    return {"ls": "none", "marker": marker, **looks}
