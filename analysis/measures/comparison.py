"""Treatments compared in pairs: tests, effect sizes and intervals, as a table."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import pandas as pd

from evoros.base.arrays import Array

from .effect_sizes import a12_interval, name_magnitude
from .statistics import holm, mann_whitney, median_interval, minimum_p

MEASURES = ("recorded", "validated")
SIDE = ("n", "median", "median_low", "median_high")
COLUMNS = (
    *("measure", "a", "b"),
    *(f"{name}_{side}" for side in "ab" for name in SIDE),
    *("p", "p_holm", "a12", "a12_low", "a12_high", "magnitude", "least_p_holm"),
)


def compare_treatments(runs: pd.DataFrame, measures: Sequence[str] = MEASURES) -> pd.DataFrame:
    """Compare each pair of treatments ``a`` and ``b`` in each measure: a row a comparison.

    ``runs`` has a row for each run, with the columns ``treatment`` and ``measures``. Columns
    returned: ``n``, the median and its bootstrap interval of each side; ``p`` of the Mann-Whitney
    test; ``p_holm``, adjusted over all pairs of the measure; ``a12``, the probability that a run
    of ``a`` is better, its interval, and its ``magnitude`` if there are enough runs to name one;
    ``least_p_holm``, the minimum for these numbers of runs. A single treatment has one row,
    without ``b`` and comparison.
    """
    rows = [row for measure in measures for row in _compare(measure, group_values(runs, measure))]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def group_values(runs: pd.DataFrame, measure: str) -> dict[str, Array]:
    """Group the known values by treatment, in the order of the runs."""
    known = runs[runs[measure].notna()]
    groups = known.groupby("treatment", sort=False)[measure]
    return {str(name): values.to_numpy(float) for name, values in groups}


def _compare(measure: str, values: Mapping[str, Array]) -> Iterator[dict[str, object]]:
    if len(values) == 1:
        ((name, single),) = values.items()
        yield {"measure": measure, "a": name, "b": "", **_describe_side("a", single)}
    pairs = list(combinations(values, 2))
    p = [mann_whitney(values[a], values[b]) for a, b in pairs]
    minima = [minimum_p(values[a].size, values[b].size) for a, b in pairs]
    for i, (adjusted, minimum) in enumerate(zip(holm(p), holm(minima), strict=True)):
        a, b = pairs[i]
        effect = a12_interval(values[a], values[b])
        size = name_magnitude(values[a], values[b])
        yield {
            **{"measure": measure, "a": a, "b": b, "p": p[i], "p_holm": adjusted},
            **_describe_side("a", values[a]),
            **_describe_side("b", values[b]),
            **{"a12": effect.value, "a12_low": effect.low, "a12_high": effect.high},
            **{"magnitude": size, "least_p_holm": minimum},
        }


def _describe_side(side: str, values: Array) -> dict[str, object]:
    median = median_interval(values)
    numbers = (values.size, median.value, median.low, median.high)
    return {f"{name}_{side}": number for name, number in zip(SIDE, numbers, strict=True)}
