"""The same designs under conditions that come nearer to reality step by step."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

import pandas as pd

from evoros.base.errors import InputError

from .matching import apply_confirmation, find_differences, select_conditions
from .paired_scores import COLUMNS, first_key, join_designs
from .study import Study
from .treatments import label_treatments
from .validated import Scores, read_evaluations

NAMES = ("source", "design")
"""The names of a design; on all rungs it has the names of the lowest."""


def climb(study: Study) -> pd.DataFrame:
    """Pair the scores of designs on each rung with those on the next, with ``COLUMNS``.

    Rungs are evaluations as given. Designs that are not on all of them are left out and reported.
    """
    rungs = read_evaluations(study) if len(study.evaluations) > 1 else []
    if len(rungs) < 2:
        raise InputError(
            "--ladder: must be given two or more finished evaluations of the same designs, from "
            "the lowest rung to the highest; add their folders"
        )
    contents = [set(scores["content"]) for _, scores in rungs]
    common = set.intersection(*contents)
    if not common:
        raise InputError(
            "--ladder: no design is in all evaluations; evaluate the same designs on each rung"
        )
    missing = len(set.union(*contents)) - len(common)
    if missing:
        study.report(f"{missing} designs are not in all evaluations")
    table = pd.DataFrame(_pair_rungs(rungs, name_rungs(rungs)))
    table = table[[content in common for content in table["content"]]]
    first = rungs[0][1].drop_duplicates("content").set_index("content")
    table = table.assign(**{name: table["content"].map(first[name]) for name in NAMES})
    return table.assign(change=table["y_fitness"] - table["x_fitness"])[list(COLUMNS)]


def name_rungs(rungs: Sequence[Scores]) -> list[str]:
    """Name each evaluation by its choices of the parts in which they differ, else by its folder."""
    conditions = [select_conditions(evaluation) for evaluation, _ in rungs]
    choices = [apply_confirmation(evaluation.choices) for evaluation, _ in rungs]
    keys = [key for values in conditions[1:] for key in find_differences(conditions[0], values)]
    parts = dict.fromkeys(map(first_key, keys))
    for labels in (
        [", ".join(filter(None, map(chosen.get, parts))) for chosen in choices],
        label_treatments(conditions, choices),
    ):
        if len(set(labels)) == len(labels):
            return labels
    return [evaluation.name for evaluation, _ in rungs]


def _pair_rungs(rungs: Sequence[Scores], names: Sequence[str]) -> Iterator[dict[str, Any]]:
    conditions = [select_conditions(evaluation) for evaluation, _ in rungs]
    steps = zip(pairwise(rungs), pairwise(names), pairwise(conditions), strict=True)
    for ((_, lower), (_, upper)), (x, y), (one, other) in steps:
        parts = dict.fromkeys(map(first_key, find_differences(one, other)))
        between = " and ".join(parts) or "draws"
        for row in join_designs(lower, upper):
            yield {"between": between, "x": x, "y": y, "group": "", **row}
