"""Treatments side by side: every replicate, boxes, and what the statistics say of each pair."""

import argparse
from collections.abc import Hashable, Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any

import pandas as pd

from evoros.base.arrays import Array

from ..drawing.compare_figure import MEASURES, called, compare, p_text
from ..drawing.style import width as width_of
from ..measures.statistics import (
    LEVEL,
    a12,
    holm,
    least_p,
    least_replicates,
    magnitude,
    mann_whitney,
    median_interval,
)
from ..product import Product
from ..tables.matching import conditions, differing
from ..tables.study import Study
from ..tables.treatments import repeated
from ..tables.validated import BY_EVALUATION, BY_RUN, under, validations

HELP = "treatments side by side: recorded and validated fitness, tests, effect sizes, intervals"
SIDE = ("n", "median", "median_low", "median_high")
COLUMNS = (
    *("measure", "a", "b"),
    *(f"{name}_{side}" for side in "ab" for name in SIDE),
    *("p", "p_holm", "a12", "magnitude", "least_p_holm"),
)


def arguments(parser: argparse.ArgumentParser) -> None:
    """Conditions that are the same for all."""
    parser.add_argument(
        "--under",
        metavar="NAME",
        help="compare the champions' scores in the evaluations of this name or treatment instead, "
        "under the same conditions for all",
    )


def product(study: Study, options: argparse.Namespace) -> Product:
    """The command's: the picture, the comparisons, the values of each run, and what they say."""
    if options.under is None:
        runs, measures = validations(study), list(MEASURES)
        said = [*_validated_by(runs), *_own_conditions(study)]
    else:
        runs, measures = under(study, options.under), [f"under {options.under}"]
        found = int(runs[measures[0]].notna().sum())
        said = [f"fitness {measures[0]} is known of {found} of {len(runs)} champions"]
    table = comparisons(runs, measures)
    figure = compare(runs, table, width_of(options.columns))
    files = {"compare_runs.csv": runs.to_csv(index=False, lineterminator="\n").encode()}
    again = repeated(runs[["run", "treatment", "seed"]].itertuples(index=False, name=None))
    return Product(table, figure, [*again, *said, *conclusions(table)], files)


def comparisons(runs: pd.DataFrame, measures: Sequence[str] = MEASURES) -> pd.DataFrame:
    """A row for each measure and pair of treatments ``a`` and ``b`` that have it.

    ``runs`` has a row a run, with the column ``treatment`` and those of the measures. Of each side
    ``n``, the median and its bootstrap interval; ``p`` of the Mann-Whitney test; ``p_holm``,
    corrected for all pairs of the measure; ``a12``, how likely a run of ``a`` is the better one,
    and its ``magnitude``; ``least_p_holm``, the least that so many runs can give. Where there is
    one treatment, ``b`` and what compares are empty.
    """
    rows = [row for measure in measures for row in _measured(measure, values_of(runs, measure))]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def values_of(runs: pd.DataFrame, measure: str) -> dict[str, Array]:
    """The values of each treatment that has any, in the order of the runs."""
    known = runs[runs[measure].notna()]
    by_name = known.groupby("treatment", sort=False)[measure]
    return {str(name): values.to_numpy(float) for name, values in by_name}


def _measured(measure: str, values: Mapping[str, Array]) -> Iterator[dict[str, object]]:
    if len(values) == 1:
        ((name, alone),) = values.items()
        yield {"measure": measure, "a": name, "b": "", **_side("a", alone)}
    pairs = list(combinations(values, 2))
    p = [mann_whitney(values[a], values[b]) for a, b in pairs]
    least = [least_p(values[a].size, values[b].size) for a, b in pairs]
    for i, (adjusted, floor) in enumerate(zip(holm(p), holm(least), strict=True)):
        a, b = pairs[i]
        effect = a12(values[a], values[b])
        yield {
            **{"measure": measure, "a": a, "b": b, "p": p[i], "p_holm": adjusted},
            **_side("a", values[a]),
            **_side("b", values[b]),
            **{"a12": effect, "magnitude": magnitude(effect), "least_p_holm": floor},
        }


def _side(side: str, values: Array) -> dict[str, object]:
    one = median_interval(values)
    numbers = (values.size, one.value, one.low, one.high)
    return {f"{name}_{side}": number for name, number in zip(SIDE, numbers, strict=True)}


def conclusions(table: pd.DataFrame) -> list[str]:
    """A sentence for each row of ``comparisons``."""
    pairs = table.groupby("measure").size()
    return [_conclusion(row, int(pairs[row["measure"]])) for row in table.to_dict("records")]


def _conclusion(row: Mapping[Hashable, Any], pairs: int) -> str:
    a, b = row["a"], row["b"]
    if not b:
        return f"{called(row['measure'])}: all runs are of one treatment: nothing to compare"
    head = f'{called(row["measure"])}, "{a}" against "{b}"'
    if row["least_p_holm"] >= LEVEL:
        return (
            f"{head}: too few replicates ({row['n_a']} and {row['n_b']}) for any conclusion: at "
            f"least {least_replicates(pairs)} in each are needed"
        )
    found = f"{p_text(row['p_holm'])} (Holm), A12 = {row['a12']:.2f} ({row['magnitude']})"
    if row["p_holm"] >= LEVEL:
        return f"{head}: no difference shown at the 5 % level: {found}"
    return f'{head}: "{a if row["a12"] > 0.5 else b}" is higher: {found}'


def _validated_by(runs: pd.DataFrame) -> Iterator[str]:
    """Where the validated fitness is from: the trials of a run are few."""
    for by, column in ((BY_EVALUATION, "fresh_trials"), (BY_RUN, "in_run_trials")):
        those = runs[runs["validated_by"] == by]
        if len(those):
            trials = ", ".join(f"{count:.0f}" for count in sorted(set(those[column])))
            whose = "evaluations" if by == BY_EVALUATION else "the runs themselves"
            share = f"{len(those)} of {len(runs)} runs"
            yield f"validated fitness of {share}: by {whose}, {trials} trials"
    if (runs["validated_by"] != BY_EVALUATION).any():
        yield (
            "for a validation on more trials score the champions under the conditions of their "
            "runs, and give that folder, too: evoros-evaluate designs=SWEEP trials=40 ..."
        )


def _own_conditions(study: Study) -> Iterator[str]:
    """What else than the designs differs between treatments."""
    each = [conditions(record) for record in study.records]
    parts = dict.fromkeys(key.split(".")[0] for one in each for key in differing(one, each[0]))
    if parts:
        yield (
            f"the runs differ in {' and '.join(parts)}, and each is measured under its own: a "
            f"difference may be of the conditions, not of the designs; --under NAME compares all "
            f"in one evaluation"
        )
