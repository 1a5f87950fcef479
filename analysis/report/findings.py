"""The findings of a study in sentences: which treatment is better, and how sure that is."""

from collections.abc import Iterator

import pandas as pd

from evoros.base.errors import InputError, single_line

from ..figures.options import score_runs
from ..statistics.comparison import compare_treatments, conclude, title_measure
from ..statistics.small_samples import median_interval
from ..tables.records import label_fitness
from ..tables.study import Study

VALIDATED, RECORDED = "validated", "recorded"


def list_findings(study: Study) -> tuple[list[str], str]:
    """Return the findings of the runs, and why there are none, which is empty if there are some."""
    if not study.records:
        return ([], "There are no runs to compare: give their folders besides the evaluations.")
    try:
        runs, measures = score_runs(study, None)
        measure = next(name for name in (VALIDATED, RECORDED) if name in measures)
        if runs[VALIDATED].isna().all():
            measure = RECORDED
        table = compare_treatments(runs, [measure])
        label = label_fitness(study.records)
        lines = [*_describe_treatments(runs, measure, label), *conclude(table, label)]
    except InputError as error:
        return [], single_line(error)
    warnings = [f"WARNING: {r.name}: {r.not_run}" for r in study.records if r.not_run]
    return [*warnings, *lines, *_describe_best(study, label), *_describe_scale(measure)], ""


def _describe_treatments(runs: pd.DataFrame, measure: str, label: str) -> Iterator[str]:
    """Yield the median of each treatment with its interval, the best first."""
    by = runs.dropna(subset=measure).groupby("treatment", sort=False)[measure]
    for treatment in by.median().sort_values(ascending=False).index:
        values = by.get_group(treatment).to_numpy(float)
        runs_of = f"{median_interval(values).write()} of {values.size} run"
        yield f"{treatment}: median {title_measure(measure, label)} {runs_of}" + "s" * (
            values.size > 1
        )


def _describe_best(study: Study, label: str) -> Iterator[str]:
    """Yield the best design, with the interval of its fitness and the chance of a better one."""
    try:
        best = study.ranked[0]
    except InputError:
        return
    status = best.run.status
    value, low, high = (
        status.get(name) for name in ("best_validated_fitness", "fitness_low", "fitness_high")
    )
    scores = f"{title_measure(RECORDED, label)} {status['best_fitness']:.2f}"
    if value is not None:
        scores = f"{title_measure(VALIDATED, label)} {value:.2f}"
        scores += "" if low is None else f" [{low:.2f}, {high:.2f}]"
    yield f"the best design is of {best.name} ({best.treatment}, seed {best.seed}): {scores}"
    chance = status.get("chance_of_better")
    if chance is not None:
        yield f"the chance that another design of that run is better: {100 * chance:.0f} %"


def _describe_scale(measure: str) -> Iterator[str]:
    yield "brackets are 95 % intervals"
    if measure == RECORDED:
        yield "recorded scores are on the draws that selected a design: luck is part of them"
