"""The picture of docs/redundancy.md."""

from typing import Any

import drop_out
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from redundancy_searches import FAILURES, SENSORS
from tabulated import Table

from evoros.analysis.drawing.style import BLUE, GREEN, PAGE_IN, VERMILLION, use_style
from evoros.analysis.statistics.small_samples import mean_interval

BACKED = (0.1, 0.3, 0.5)
LEGEND: dict[str, Any] = {"frameon": False, "ncols": 4, "columnspacing": 1.0, "handletextpad": 0.4}
COLOURS = ("#9ecae1", "#4292c6", "#2171b5", "#08306b")  # of rates, the higher the darker


def draw(optima: pd.DataFrame, table: Table, searches: pd.DataFrame) -> Figure:
    """Draw optima by budget, backups by pairs against the truth, and the regret of searches."""
    with use_style():
        whole = Figure(figsize=(PAGE_IN, 0.42 * PAGE_IN), layout="constrained")
        left, middle, right = whole.subplots(1, 3, width_ratios=[1.0, 1.0, 1.15])
        _draw_optima(left, optima)
        _draw_backups(middle, table)
        _draw_searches(right, searches)
        for letter, axes in zip("abc", (left, middle, right), strict=True):
            axes.set_title(f"({letter})", loc="left")
        whole.legend(*right.get_legend_handles_labels(), loc="outside lower right", **LEGEND)
        lines = left.get_legend_handles_labels()[0]
        labels = [f"rate {rate:g}" for rate in sorted(set(optima.rate))]
        whole.legend(lines, labels, loc="outside lower left", **LEGEND)
    return whole


def _draw_optima(axes: Axes, optima: pd.DataFrame) -> None:
    """Draw the score of the best set, and of the best one without failures, by the budget."""
    for (rate, rows), colour in zip(optima.groupby("rate"), COLOURS, strict=True):
        axes.plot(rows.budget, rows.score, "o-", color=colour, ms=3, lw=1.2, label=f"{rate:g}")
        axes.plot(rows.budget, rows["for rate 0"], "--", color=colour, lw=1.0)
    axes.set_xlabel("budget (sensors)")
    axes.set_ylabel("expected fitness (Eq. 1)")


def _draw_backups(axes: Axes, table: Table) -> None:
    """Draw the approximation of all sets of backups within the budget against the truth."""
    places, scores = len(table.places), table.scores.mean(0)
    sets = drop_out.within(places, SENSORS)
    fit = drop_out.make_fit(places, drop_out.near(places, (1 << places) - 1))
    values: list[float] = []
    for rate, colour in zip(BACKED, COLOURS[1:], strict=True):
        truth, guess = (drop_out.back_up(s, rate)[sets] for s in (scores, fit @ scores))
        chosen = np.argmax(guess)
        axes.plot(truth, guess, "o", color=colour, ms=2.2, alpha=0.6, mew=0)
        axes.plot(truth[chosen], guess[chosen], "D", color=VERMILLION, ms=4)
        axes.plot(truth.max(), guess[np.argmax(truth)], "*", color=GREEN, ms=8, mew=0)
        values += [truth.min(), truth.max()]
    axes.plot([min(values), max(values)], [min(values), max(values)], color="0.6", lw=0.8, zorder=0)
    axes.set_xlabel("expected fitness with backups")
    axes.set_ylabel("fitness estimated by pairs")


def _draw_searches(axes: Axes, searches: pd.DataFrame) -> None:
    """Draw the mean regret of each answer, with its interval, for each kind of failure."""
    names = list(dict.fromkeys(searches.search))
    for place, (failure, colour) in enumerate(
        zip(FAILURES, (BLUE, GREEN, VERMILLION), strict=True)
    ):
        rows: Any = searches[searches.failure == failure]
        means = [mean_interval(rows[rows.search == name].regret.to_numpy()) for name in names]
        y = np.arange(len(names))[::-1] + 0.22 * (1 - place)
        axes.hlines(y, [m.low for m in means], [m.high for m in means], color=colour, lw=1.4)
        axes.plot([m.value for m in means], y, "o", color=colour, ms=3.5, label=failure)
    axes.set_yticks(range(len(names)), [_shorten(name) for name in names[::-1]])
    axes.set_xlim(left=0)
    axes.set_xlabel("mean regret (fitness)")


def _shorten(name: str) -> str:
    """Write a search with a final choice as an addition to the one above it."""
    return "+ final choice" if name.endswith(", final choice") else name
