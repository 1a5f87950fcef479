"""The champions of several treatments with all their sensors, on robots from above."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from evoros.storage.figure_context import FigureContext

from ..tables.champions import BEST_SO_FAR
from ..tables.designs import SIGNAL_COLUMNS
from ..tables.treatments import SINGLE
from . import robot
from .signals import draw_signals, make_signal_handles


@dataclass(frozen=True, eq=False)
class Champions:
    """Champions with their sensors; a row without a place is a champion without sensors."""

    sensors: pd.DataFrame
    contexts: Mapping[str, FigureContext]  # by treatment
    signals: pd.DataFrame | None = None  # sensors that cast no rays, as ``Study.signals``
    unfinished: Collection[str] = ()  # runs whose best so far stands for the champion

    @cached_property
    def placed(self) -> pd.DataFrame:
        """The sensors that have a place."""
        return self.sensors.dropna(subset="x_m")

    @cached_property
    def others(self) -> pd.DataFrame:
        """The sensors that cast no rays."""
        return pd.DataFrame(columns=SIGNAL_COLUMNS) if self.signals is None else self.signals

    @cached_property
    def markers(self) -> dict[str, str]:
        """The marker of each type of sensor."""
        return robot.assign_markers(self.placed)

    @cached_property
    def numbers(self) -> "pd.Series[int]":
        """The number of champions of each treatment."""
        return self.sensors.groupby("treatment").run.nunique()

    @property
    def several(self) -> bool:
        """Whether a treatment has several champions."""
        return int(self.numbers.max()) > 1

    def make_handles(self, with_rays: bool = True) -> list[Line2D | Patch]:
        """Make the legend entries of places and types of sensors."""
        places = robot.make_place_handles(self.placed)
        types = robot.make_type_handles(self.markers)
        return [*places[: None if with_rays else 1], *types, *make_signal_handles(self.others)]

    def draw_on_each_other(self, axes: Axes, treatment: str, cut_m: float, places: bool) -> None:
        """Draw the rays of a treatment's champions and, if wanted, the places of the sensors."""
        chosen = self.placed[self.placed.treatment == treatment]
        alpha = 0.35 if self.several else 0.8  # dots on each other are darker
        robot.draw_rays(axes, chosen, [robot.RAY] * len(chosen), cut_m, alpha)
        if places:
            robot.draw_sensors(axes, chosen, ["black"] * len(chosen), self.markers, (2.5, alpha))
            if len(self.others):
                signals = self.others[self.others.treatment == treatment]
                draw_signals(axes, signals, self.contexts[treatment], alpha)

    def describe(self, treatment: str) -> str:
        """Describe a treatment; a single champion has its fitness on a line of its own."""
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
        """Count the champions of a treatment, and the best so far of its unfinished runs."""
        runs = self.sensors[self.sensors.treatment == treatment].run.unique()
        unfinished = sum(run in self.unfinished for run in runs)
        champions = len(runs) - unfinished
        if champions == 0:
            return BEST_SO_FAR if unfinished == 1 else f"{unfinished} runs, {BEST_SO_FAR}"
        count = f"{champions} champion" + "s" * (champions > 1)
        return f"{count}, {unfinished} {BEST_SO_FAR}" if unfinished else count
