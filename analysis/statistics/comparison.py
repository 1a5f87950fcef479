"""Pairwise comparisons of treatments: tests, effect sizes, intervals, conclusions."""

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from evoros.base.arrays import Array

from ..tables.records import FITNESS
from .small_samples import LEVEL, fisher, holm, median_interval, share_interval
from .two_samples import TEST, a12_interval, brunner_munzel, minimum_p, minimum_replicates

MEASURES = ("recorded", "validated")
MANY = 3  # number of pairs above which conclusions list only significant differences
SIDE = ("n", "median", "median_low", "median_high")
COLUMNS = (
    *("measure", "a", "b"),
    *(f"{name}_{side}" for side in "ab" for name in SIDE),
    *("p", "p_holm", "a12", "a12_low", "a12_high", "least_p_holm", "tests"),
)


def compare_treatments(
    runs: pd.DataFrame, measures: Sequence[str] = MEASURES, reference: str | None = None
) -> pd.DataFrame:
    """Compare each pair of treatments, or each treatment with ``reference``, by each measure."""
    rows = [
        row
        for measure in measures
        for row in _compare(measure, group_values(runs, measure), reference)
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def group_values(runs: pd.DataFrame, measure: str) -> dict[str, Array]:
    """Group known values by treatment, in the order of the runs."""
    known = runs[runs[measure].notna()]
    groups = known.groupby("treatment", sort=False)[measure]
    return {str(name): values.to_numpy(float) for name, values in groups}


def _compare(
    measure: str, values: Mapping[str, Array], reference: str | None
) -> Iterator[dict[str, object]]:
    if len(values) == 1:
        ((name, single),) = values.items()
        yield {"measure": measure, "a": name, "b": "", **_describe_side("a", single)}
    pairs = list_pairs(values, reference)
    p = [brunner_munzel(values[a], values[b]) for a, b in pairs]
    minima = [minimum_p(values[a].size, values[b].size) for a, b in pairs]
    for i, (adjusted, minimum) in enumerate(zip(holm(p), holm(minima), strict=True)):
        a, b = pairs[i]
        effect = a12_interval(values[a], values[b])
        yield {
            **{"measure": measure, "a": a, "b": b, "p": p[i], "p_holm": adjusted},
            **_describe_side("a", values[a]),
            **_describe_side("b", values[b]),
            **{"a12": effect.value, "a12_low": effect.low, "a12_high": effect.high},
            **{"least_p_holm": minimum, "tests": len(pairs)},
        }


def list_pairs(names: Iterable[str], reference: str | None) -> list[tuple[str, str]]:
    """List all pairs of treatments, or the pairs with the reference."""
    pairs = combinations(names, 2)
    return [(a, b) for a, b in pairs if reference in (None, a, b)]


def _describe_side(side: str, values: Array) -> dict[str, object]:
    median = median_interval(values)
    numbers = (values.size, median.value, median.low, median.high)
    return {f"{name}_{side}": value for name, value in zip(SIDE, numbers, strict=True)}


def compare_reached(table: pd.DataFrame, runs: pd.DataFrame, column: str) -> pd.DataFrame:
    """Add the share of runs with a value in ``column``, with Fisher's exact test, to each row.

    Holm's adjustment then covers both tests of all pairs, because either can favour a treatment.
    """
    groups = runs.groupby("treatment", sort=False)[column]
    known = {str(name): (int(cost.count()), len(cost)) for name, cost in groups}
    rows = []
    for a, b in zip(table["a"], table["b"], strict=True):
        sides = {side: known.get(name, (0, 0)) for side, name in (("a", a), ("b", b))}
        row = {"p_reached": fisher(*sides["a"], *sides["b"])}
        for side, (count, total) in sides.items():
            share = share_interval(count, total)
            row[f"reached_{side}"] = share.value
            row[f"reached_low_{side}"], row[f"reached_high_{side}"] = share.low, share.high
        rows.append(row)
    added = pd.DataFrame(rows)
    order = [f"reached{end}_{side}" for side in "ab" for end in ("", "_low", "_high")]
    joint = table.assign(**added[[*order, "p_reached"]], p_reached_holm=np.nan)
    if (table["b"] == "").any():  # nothing to compare
        return joint
    pairs, sizes = len(table), list(zip(table["n_a"], table["n_b"], strict=True))
    adjusted = holm([*table["p"], *added["p_reached"]])
    minima = [minimum_p(a, b) for a, b in sizes] + [fisher(0, a, b, b) for a, b in sizes]
    joint["p_holm"], joint["p_reached_holm"] = adjusted[:pairs], adjusted[pairs:]
    return joint.assign(least_p_holm=holm(minima)[:pairs], tests=2 * pairs)


def title_measure(measure: str, label: str = FITNESS) -> str:
    """Return the title of a score column; ``label`` names the fitness."""
    return f"{measure} {label}" if measure in MEASURES else f"{label} {measure}"


def conclude(table: pd.DataFrame, label: str = FITNESS) -> list[str]:
    """Return a sentence per row or, for many rows, per significant difference."""
    said: list[str] = []
    for measure, rows in table.groupby("measure", sort=False):
        pairs = rows.to_dict("records")
        head = f"{title_measure(str(measure), label)}, {len(pairs)} pairs"
        if len(pairs) > 1 and (rows["least_p_holm"] >= LEVEL).all():
            counts = [row[name] for row in pairs for name in ("n_a", "n_b")]
            said.append(f"{head}: {ask_for_replicates(counts, int(pairs[0]['tests']))}")
            continue
        told = [row for row in pairs if len(pairs) <= MANY or row["p_holm"] < LEVEL]
        said += [_conclude_pair(row, label) for row in told]
        if len(told) < len(pairs):
            said.append(f"{head}: no significant difference in {len(pairs) - len(told)} of them")
    return said


def _conclude_pair(row: Mapping[Hashable, Any], label: str) -> str:
    a, b = row["a"], row["b"]
    measure = title_measure(row["measure"], label)
    if not b:
        return f"{measure}: all runs belong to one treatment, so there is nothing to compare"
    head = f'{measure}, "{a}" versus "{b}"'
    if row["least_p_holm"] >= LEVEL:
        return f"{head}: {ask_for_replicates((row['n_a'], row['n_b']), int(row['tests']))}"
    result = f"{format_p(row['p_holm'])} ({TEST}, Holm), A12 = {format_effect(row)} (95 % interval)"
    if row["p_holm"] >= LEVEL:
        return f"{head}: no significant difference at the 5 % level: {result}"
    return f'{head}: "{a if row["a12"] > 0.5 else b}" is higher: {result}'


def ask_for_replicates(counts: Sequence[int], tests: int) -> str:
    """Explain that there are too few replicates for a family of tests."""
    needed = minimum_replicates(tests)
    known = " to ".join(dict.fromkeys((str(min(counts)), str(max(counts)))))
    return (
        f"too few replicates ({known}) for any conclusion: each treatment needs at least {needed}; "
        f"type: evoros -m ... 'seed=range({needed})'"
    )


def format_effect(row: Mapping[Hashable, Any]) -> str:
    """Format A12 with its interval."""
    return f"{row['a12']:.2f} [{row['a12_low']:.2f}, {row['a12_high']:.2f}]"


def format_p(p: float) -> str:
    """Format a p-value."""
    return "p < 0.001" if p < 0.001 else f"p = {p:.3f}"
