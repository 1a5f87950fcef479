"""The tables of the page of BARN: designs in public worlds, and searches by what they reach."""

import csv
import warnings
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import scipy

from evoros.analysis.statistics.regression import sign_flips
from evoros.analysis.statistics.small_samples import (
    LEVEL,
    Interval,
    holm,
    mean_interval,
    share_interval,
)
from evoros.base.arrays import Array
from evoros.mission.mission import COLLISION
from evoros.plugins.barn.fitness import score_mission
from evoros.storage.tables import read_outcomes

BUDGETS = (8.0, 24.0, 100.0, 600.0)
"""Prices of all sensors of a design [EUR]."""
Missions = pd.DataFrame
"""A row for each mission of a design, and its score."""


def read_missions(folder: Path) -> dict[int, Missions]:
    """Read the missions of each design of an evaluation."""
    with (folder / "missions.csv").open(newline="") as file:
        rows = [(row, read_outcomes(row)[0]) for row in csv.DictReader(file)]
    missions = pd.DataFrame(
        {
            "design": int(row["design"]),
            "trial": int(row["trial"]),
            "score": score_mission(outcome),
            "completed": outcome.completed,
            "collided": outcome.ended == COLLISION,
            "time_s": outcome.time_s,
            "sensors": outcome.sensors,
            "price": outcome.price,
        }
        for row, outcome in rows
    )
    return {int(str(one)): rows for one, rows in missions.groupby("design")}


def summarize(designs: Mapping[int, Missions]) -> pd.DataFrame:
    """Return a row for each design, from the cheapest on."""
    rows = {one: missions.mean(numeric_only=True) for one, missions in designs.items()}
    return pd.DataFrame(rows).T.sort_values(["price", "score"], ascending=[True, False])


def choose(fronts: Iterable[pd.DataFrame], budget: float) -> pd.DataFrame:
    """Return the dearest design of each front within the budget, the best in fresh worlds."""
    return pd.DataFrame([front[front["price"] <= budget].iloc[-1] for front in fronts])


def list_reached(
    fronts: Sequence[pd.DataFrame], lidars: Sequence[pd.DataFrame]
) -> dict[str, pd.DataFrame]:
    """Return a row for each search: within each budget, and with the challenge's lidar."""
    reached = {f"at most {one:g} EUR": choose(fronts, one) for one in BUDGETS}
    return reached | {"network, the challenge's lidar": choose(lidars, np.inf)}


def compare(one: Array, other: Array, paired: bool) -> tuple[Interval, float]:
    """Return by how much the mean of one exceeds that of the other, and p by Student or Welch."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of equal values, which have no interval
        test = (
            scipy.stats.ttest_1samp(one - other, 0.0)
            if paired
            else scipy.stats.ttest_ind(one, other, equal_var=False)
        )
        low, high = map(float, test.confidence_interval(1 - LEVEL))
    p = 1.0 if np.isnan(test.pvalue) else float(test.pvalue)
    return Interval(float(one.mean() - other.mean()), low, high), p


def student(values: Array) -> Interval:
    """Return the mean and its interval by Student's t; a bootstrap of few seeds is too narrow."""
    return compare(values, np.zeros_like(values), paired=True)[0]


def tabulate_searches(reached: Mapping[str, pd.DataFrame]) -> str:
    """Write what searches reach."""
    rows = [
        [
            name,
            len(rows),
            *(_write_span(rows[key], "g") for key in ("sensors", "price")),
            student(rows["score"].to_numpy()).write(".3f"),
            _write_span(rows["score"], ".3f"),
            f"{rows['completed'].mean():.0%}",
        ]
        for name, rows in reached.items()
    ]
    heads = ["design", "searches", "sensors", "price [EUR]", "score [95 %]", "range", "success"]
    return write_table(heads, rows)


def tabulate_comparisons(reached: Mapping[str, pd.DataFrame], hand: float) -> str:
    """Write all against the hand-made robot, and the steps of the budget, corrected by Holm."""
    scores = {name: rows["score"].to_numpy() for name, rows in reached.items()}
    compared = {
        f"hand-made over {name}": compare(np.full_like(values, hand), values, paired=True)
        for name, values in scores.items()
    }
    for cheap, dear in pairwise(scores):
        paired = len(scores[cheap]) == len(scores[dear])  # not with the lidar: other searches
        compared[f"{dear} over {cheap}"] = compare(scores[dear], scores[cheap], paired)
    adjusted = holm([p for _, p in compared.values()])
    rows = [
        [name, difference.write("+.3f"), f"{p:.2g}"]
        for (name, (difference, _)), p in zip(compared.items(), adjusted, strict=True)
    ]
    return write_table(["comparison", "difference [95 %]", "p (Holm)"], rows)


def tabulate_worlds(entries: Mapping[str, Missions], against: Mapping[str, str]) -> str:
    """Write designs with intervals over the worlds (permutation of signs, Holm).

    ``against`` names the design with which one is compared.
    """
    scores = {name: rows.set_index("trial")["score"] for name, rows in entries.items()}
    more = {one: (scores[one] - scores[other]).to_numpy() for one, other in against.items()}
    adjusted = dict(zip(more, holm([*map(sign_flips, more.values())]), strict=True))
    rows = [
        [
            name,
            f"{missions['sensors'].iloc[0]}",
            f"{missions['price'].iloc[0]:g}",
            mean_interval(scores[name].to_numpy()).write(".3f"),
            share_interval(int(missions["completed"].sum()), len(missions)).write(".0%"),
            f"{missions['collided'].mean():.1%}",
            (-mean_interval(more[name])).write(".3f") if name in more else "",
            f"{adjusted[name]:.2g}" if name in more else "",
        ]
        for name, missions in entries.items()
    ]
    heads = ["design", "sensors", "price [EUR]", "score [95 %]", "success [95 %]", "collided"]
    return write_table([*heads, "less by", "p (Holm)"], rows)


def write_table(heads: Sequence[object], rows: Iterable[Sequence[object]]) -> str:
    """Write a table as Markdown."""
    head, *lines = (f"| {' | '.join(map(str, row))} |" for row in (heads, *rows))
    return "\n".join([head, "|" + "---|" * len(heads), *lines])


def fill(page: str, tables: Mapping[str, str]) -> str:
    """Return a page with tables between the marks that it has for them."""
    for name, table in tables.items():
        before, mark, rest = page.partition(f"<!-- measured: {name} -->")
        if mark:
            _, end, after = rest.partition("<!-- end -->")
            page = f"{before}{mark}\n\n{table}\n\n{end}{after}"
    return page


def _write_span(values: pd.Series, form: str) -> str:
    """Write the minimum and the maximum, or the one value."""
    ends = (f"{values.min():{form}}", f"{values.max():{form}}")
    return " to ".join(dict.fromkeys(ends))
