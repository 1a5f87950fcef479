"""Tabulates what BARN searches reach within a budget, with intervals over the searches.

The arguments are folders: the evaluation of the hand-made robot, the folder of the scored runs of
experiment=barn (barn_choice.py), a folder for each seed, and the same of the runs with the lidar:

    python benchmarks/studies/barn_seeds.py GAP SCORED LIDAR

A search is represented by the design of its front that is best in fresh drawn worlds and costs at
most the budget. Its score is the mean over the public worlds, which are the same for all.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import scipy
from barn import read_missions

from evoros.analysis.statistics.small_samples import LEVEL, Interval, holm
from evoros.base.arrays import Array
from evoros.mission.outcome import COMPLETED

BUDGETS = (8.0, 24.0, 100.0, 600.0)


@dataclass(frozen=True)
class Reached:
    """What searches reach in the public worlds, a row for each seed."""

    name: str
    rows: pd.DataFrame  # sensors, price, score, success

    @property
    def scores(self) -> Array:
        """The score of each seed."""
        return self.rows["score"].to_numpy()


def read_front(folder: Path) -> pd.DataFrame:
    """Return a row for each design of a scored front, from the cheapest on."""
    missions = read_missions(folder / "public")
    missions["success"] = missions["ended"] == COMPLETED
    columns = {"sensors": "first", "price": "first", "score": "mean", "success": "mean"}
    return missions.groupby("design", sort=False).agg(columns).sort_values("price")


def read_seeds(folder: Path) -> dict[str, pd.DataFrame]:
    """Return the front of each seed, by the name of its folder."""
    return {one.name: read_front(one) for one in sorted(folder.iterdir())}


def choose(fronts: Sequence[pd.DataFrame], budget: float) -> pd.DataFrame:
    """Return the dearest design of each front within the budget.

    A front holds designs that are above all cheaper ones in fresh worlds, so it is the best there.
    """
    return pd.DataFrame([front[front["price"] <= budget].iloc[-1] for front in fronts])


def list_reached(fronts: Sequence[pd.DataFrame], lidars: Sequence[pd.DataFrame]) -> list[Reached]:
    """Return a row of the table for each budget, and one for the lidar."""
    budgets = [Reached(f"at most {one:g} EUR", choose(fronts, one)) for one in BUDGETS]
    return [*budgets, Reached("network, the challenge's lidar", choose(lidars, np.inf))]


def student(values: Array) -> Interval:
    """Return the mean and its interval by Student's t; a bootstrap of few seeds is too narrow."""
    if len(values) < 2 or np.ptp(values) == 0.0:
        return Interval(float(values.mean()))
    bounds = scipy.stats.ttest_1samp(values, 0.0).confidence_interval(1 - LEVEL)
    return Interval(float(values.mean()), float(bounds.low), float(bounds.high))


def compare(one: Array, other: Array, paired: bool) -> tuple[Interval, float]:
    """Return by how much the mean of one exceeds that of the other, and p by Student or Welch."""
    if paired:
        differences = one - other
        if not differences.any():
            return student(differences), 1.0
        return student(differences), float(scipy.stats.ttest_1samp(differences, 0.0).pvalue)
    test = scipy.stats.ttest_ind(one, other, equal_var=False)
    bounds = test.confidence_interval(1 - LEVEL)
    difference = float(one.mean() - other.mean())
    return Interval(difference, float(bounds.low), float(bounds.high)), float(test.pvalue)


def list_comparisons(
    reached: Sequence[Reached], hand: float
) -> Iterator[tuple[str, Interval, float]]:
    """Yield a name, the difference and p: all against the hand-made robot, steps of the budget."""
    for one in reached:
        better = compare(np.full_like(one.scores, hand), one.scores, paired=True)
        yield f"hand-made over {one.name}", *better
    *budgets, lidar = reached
    for cheap, dear in pairwise(budgets):
        yield f"{dear.name} over {cheap.name}", *compare(dear.scores, cheap.scores, paired=True)
    last = budgets[-1]
    yield f"{lidar.name} over {last.name}", *compare(lidar.scores, last.scores, paired=False)


def write_span(values: pd.Series, form: str) -> str:
    """Write the minimum and the maximum, or the one value."""
    ends = (f"{values.min():{form}}", f"{values.max():{form}}")
    return " to ".join(dict.fromkeys(ends))


def main(gap: str, scored: str, lidar: str) -> None:
    """Print the table of the budgets and the one of the comparisons."""
    hand = float(read_missions(Path(gap))["score"].mean())
    fronts, lidars = (read_seeds(Path(folder)) for folder in (scored, lidar))
    reached = list_reached([*fronts.values()], [*lidars.values()])
    print("| design | searches | sensors | price [EUR] | score [95 %] | range | success |")
    print("|---|---|---|---|---|---|---|")
    for one in reached:
        rows, spans = one.rows, [write_span(one.rows[key], "g") for key in ("sensors", "price")]
        cells = [one.name, f"{len(rows)}", *spans, student(one.scores).write(".3f")]
        cells += [write_span(rows["score"], ".3f"), f"{rows['success'].mean():.0%}"]
        print("| " + " | ".join(cells) + " |")
    compared = list(list_comparisons(reached, hand))
    print("\n| comparison | difference [95 %] | p (Holm) |\n|---|---|---|")
    for (name, difference, _), p in zip(compared, holm([p for *_, p in compared]), strict=True):
        print(f"| {name} | {difference.write('+.3f')} | {p:.2g} |")


if __name__ == "__main__":
    main(*sys.argv[1:])
