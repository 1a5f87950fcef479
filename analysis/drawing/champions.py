"""The champions of several treatments with all their sensors, on robots seen from above."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from evoros.sensor.protocol import CONTACT, MOTION, WHEELS
from evoros.storage.figure_context import FigureContext

from ..designs.cones import trace_zone
from ..tables.champions import BEST_SO_FAR
from ..tables.designs import SIGNAL_COLUMNS
from ..tables.treatments import SINGLE
from . import robot
from .robot import to_page
from .style import PURPLE

_MARKERS = {WHEELS: ("p", 6.5), MOTION: ("X", 4.0), CONTACT: ("*", 4.0)}
"""Marker and size [pt] by measured quantity."""
_HATCH = "/////"


@dataclass(frozen=True, eq=False)
class Champions:
    """Champions and their sensors; a row without a place is a champion without sensors."""

    sensors: pd.DataFrame
    contexts: Mapping[str, FigureContext]  # one per treatment
    signals: pd.DataFrame | None = None  # sensors that cast no rays; see ``Study.signals``
    unfinished: Collection[str] = ()  # runs that show their best design so far

    @cached_property
    def placed(self) -> pd.DataFrame:
        """The sensors with a place."""
        return self.sensors.dropna(subset="x_m")

    @cached_property
    def others(self) -> pd.DataFrame:
        """The sensors that cast no rays."""
        return pd.DataFrame(columns=SIGNAL_COLUMNS) if self.signals is None else self.signals

    @cached_property
    def markers(self) -> dict[str, str]:
        """The marker of each sensor type."""
        return robot.assign_markers(self.placed)

    @cached_property
    def numbers(self) -> "pd.Series[int]":
        """The number of champions per treatment."""
        return self.sensors.groupby("treatment").run.nunique()

    @property
    def several(self) -> bool:
        """True if a treatment has several champions."""
        return int(self.numbers.max()) > 1

    def make_handles(self, with_rays: bool = True) -> list[Line2D | Patch]:
        """Make the legend entries of places and sensor types."""
        places = robot.make_place_handles(self.placed)
        types = robot.make_type_handles(self.markers)
        return [*places[: None if with_rays else 1], *types, *_make_signal_handles(self.others)]

    def draw_on_each_other(self, axes: Axes, treatment: str, cut_m: float, places: bool) -> None:
        """Draw the rays of a treatment's champions and, optionally, their sensors' places."""
        chosen = self.placed[self.placed.treatment == treatment]
        alpha = 0.35 if self.several else 0.8  # overlapping dots are darker
        robot.draw_rays(axes, chosen, [robot.RAY] * len(chosen), cut_m, alpha)
        if places:
            robot.draw_sensors(axes, chosen, ["black"] * len(chosen), self.markers, (2.5, alpha))
            if len(self.others):
                signals = self.others[self.others.treatment == treatment]
                draw_signals(axes, signals, self.contexts[treatment], alpha)

    def describe(self, treatment: str) -> str:
        """Describe a treatment; a single champion's fitness is on a separate line."""
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
        """Count a treatment's champions, and the best designs so far of its unfinished runs."""
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
    """Draw each sensor's place, and each bumper's zone up to the robot's edge."""
    columns = ["x_m", "y_m", "yaw_deg", "width_m", "depth_m"]
    bumpers = signals.loc[signals["width_m"] > 0.0, columns].to_numpy(float).tolist()
    zones = [
        to_page(trace_zone((x, y), yaw, width, depth, context))
        for x, y, yaw, width, depth in bumpers
    ]
    look: dict[str, Any] = {"facecolors": "none", "edgecolors": PURPLE, "linewidths": 0.6}
    drawn = PolyCollection(zones, hatch=_HATCH, alpha=alpha, zorder=3.5, **look)
    axes.add_collection(drawn, autolim=False)
    for order, measures in enumerate(_MARKERS):  # smaller markers are drawn later
        shown = (signals["measures"] == measures) & (signals["width_m"] <= 0.0)
        places = to_page(signals.loc[shown, ["x_m", "y_m"]].to_numpy(float))
        axes.plot(*places.T, **_style(measures), alpha=alpha, zorder=4.5 + 0.01 * order)


def _make_signal_handles(signals: pd.DataFrame) -> list[Line2D | Patch]:
    kinds = signals.drop_duplicates("type")
    return [
        Patch(fc="none", ec=PURPLE, hatch=_HATCH, lw=0.6, label=f"{kind}, its zone")
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
