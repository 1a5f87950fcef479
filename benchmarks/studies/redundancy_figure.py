"""The picture of docs/redundancy.md."""

from typing import Any

import drop_out
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from redundancy_searches import FAILURES, RATE, SENSORS
from tabulated import Table

from evoros.analysis.drawing.style import BLUE, GREEN, PAGE_IN, VERMILLION, use_style
from evoros.analysis.statistics.small_samples import mean_interval

COLOURS = ("#9ecae1", "#4292c6", "#2171b5", "#08306b")  # of rates, the higher the darker


def draw(optima: pd.DataFrame, table: Table, searches: pd.DataFrame) -> Figure:
    """Draw optima by budget, the approximation against the truth, and the regret of searches."""
    with use_style():
        whole = Figure(figsize=(PAGE_IN, 0.4 * PAGE_IN), layout="constrained")
        left, middle, right = whole.subplots(1, 3, width_ratios=[1.0, 1.0, 1.1])
        _draw_optima(left, optima)
        _draw_pairs(middle, table)
        _draw_searches(right, searches)
        for letter, axes in zip("abc", (left, middle, right), strict=True):
            axes.set_title(f"({letter})", loc="left")
    return whole


def _draw_optima(axes: Axes, optima: pd.DataFrame) -> None:
    """Draw the score of the best set, and of the best one without failures, by the budget."""
    for (rate, rows), colour in zip(optima.groupby("rate"), COLOURS, strict=True):
        axes.plot(rows.budget, rows.score, "o-", color=colour, ms=3, lw=1.2, label=f"{rate:g}")
        axes.plot(rows.budget, rows["for rate 0"], "--", color=colour, lw=1.0)
    axes.set_xlabel("budget (sensors)")
    axes.set_ylabel("expected fitness (Eq. 1)")
    axes.legend(title="failure rate", frameon=False)


def _draw_pairs(axes: Axes, table: Table) -> None:
    """Draw the approximations of all sets within the budget against the truth."""
    places, scores = len(table.places), table.scores.mean(0)
    sets = drop_out.within(places, SENSORS)
    truth = drop_out.drop_out(scores, RATE)
    for name, fitted, colour in (
        ("around no sensor", drop_out.near(places, 0), VERMILLION),
        ("around all sensors", drop_out.near(places, (1 << places) - 1), GREEN),
        ("fit to the budget", sets, BLUE),
    ):
        approximate = drop_out.drop_out(drop_out.make_fit(places, fitted) @ scores, RATE)
        chosen = drop_out.find_best(approximate, SENSORS)
        axes.plot(truth[sets], approximate[sets], "o", color=colour, ms=2.2, alpha=0.5, mew=0)
        axes.plot(truth[chosen], approximate[chosen], "o", color=colour, ms=5, label=name)
    ends = [truth[sets].min(), truth[sets].max()]
    axes.plot(ends, ends, color="0.6", lw=0.8, zorder=0)
    axes.axvline(ends[1], color="0.6", lw=0.8, ls=":", zorder=0)
    axes.set_xlabel(f"true expected fitness, rate {RATE:g}")
    axes.set_ylabel("approximation by pairs")
    axes.legend(frameon=False)


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
    axes.set_yticks(range(len(names)), names[::-1])
    axes.set_xlim(left=0)
    axes.set_xlabel("mean regret (fitness)")
    axes.legend(frameon=False, title="what fails")
