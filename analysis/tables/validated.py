"""Champions measured again, by an evaluation or by their own run."""

import math
from collections.abc import Sequence
from typing import Any

import pandas as pd

from evoros.base.errors import InputError

from .designs import to_number
from .matching import identify_champion, list_differences, read_scores
from .records import EvaluationRecord, Record
from .study import Study

BY_EVALUATION, BY_RUN, BY_NOTHING = "evaluation", "run", ""
Scores = tuple[EvaluationRecord, pd.DataFrame]
"""An evaluation and the table of its designs."""


def validate_champions(study: Study) -> pd.DataFrame:
    """Collect the recorded and validated fitness of each finished run's champion.

    The matching evaluation with the most trials validates, otherwise the run itself. With a
    confirmation, the confirming simulator's scores count. ``docs/analysis.md`` describes the
    columns.
    """
    evaluations = read_evaluations(study)
    return study.gather(lambda record: _validate(record, evaluations))


def score_under(study: Study, name: str) -> pd.DataFrame:
    """Collect the score of each finished run's champion under common conditions.

    ``under NAME`` is the mean fitness in the evaluation of that name or treatment with the most
    trials; NaN if no such evaluation contains the champion.
    """
    evaluations = read_evaluations(study)
    column = f"under {name}"
    named = [table for record, table in evaluations if name in (record.name, record.treatment)]
    if not named:
        known = dict.fromkeys(record.treatment for record, _ in evaluations)
        fix = f"choose one of {', '.join(known)}" if known else "evaluate the champions first"
        raise InputError(
            f"--under: must be the label or name of a finished evaluation, not {name!r}; {fix}"
        )
    scores = pd.concat(named).sort_values("trials", kind="stable")
    means = dict(zip(scores["content"], scores["fitness"], strict=True))

    def score(record: Record) -> pd.DataFrame:
        record.require_finished()
        return pd.DataFrame([{column: means.get(identify_champion(record), math.nan)}])

    runs = study.gather(score)
    if runs[column].isna().all():
        raise InputError(
            f"--under {name}: contains no champion of these runs; type: "
            f"evoros evaluate designs=SWEEP ..."
        )
    return runs


def read_evaluations(study: Study) -> list[Scores]:
    """Read the scores of the finished evaluations; report each other evaluation."""
    return list(study.read_each(study.evaluations, read_scores))


def list_unused(study: Study) -> dict[str, list[str]]:
    """List, by evaluation that matches no run, the parts that differ from the most similar run."""
    unused = {}
    runs = [record for record in study.records if record.finished]
    for evaluation in study.evaluations:
        nearest = min((list_differences(evaluation, run) for run in runs), key=len, default=[])
        if nearest:
            unused[evaluation.name] = list(dict.fromkeys(key.split(".")[0] for key in nearest))
    return unused


def _validate(record: Record, evaluations: Sequence[Scores]) -> pd.DataFrame:
    record.require_finished()
    status, fresh = record.run.status, _score_freshly(record, evaluations)
    in_run = to_number(status.get("best_validated_fitness"))
    by = BY_EVALUATION if fresh else BY_NOTHING if math.isnan(in_run) else BY_RUN
    row = {
        "recorded": to_number(status.get("best_fitness")),
        "validated": fresh.get("fresh", in_run),
        "validated_by": by,
        "in_run": in_run,
        "in_run_trials": status.get("validated_trials"),
        **dict.fromkeys(("fresh", "fresh_sd", "fresh_trials"), math.nan),
        "evaluation": "",
    }
    return pd.DataFrame([row | fresh])


def _score_freshly(record: Record, evaluations: Sequence[Scores]) -> dict[str, Any]:
    """Return the champion's scores in the evaluation with the most trials; empty if none."""
    content, best = identify_champion(record), dict[str, Any]()
    for evaluation, table in evaluations:
        rows = table[[other == content for other in table["content"]]]
        if rows.empty or list_differences(evaluation, record):
            continue
        fitness, sd, trials = rows.iloc[0][["fitness", "fitness_sd", "trials"]]
        if not best or trials > best["fresh_trials"]:
            best = {"fresh": float(fitness), "fresh_sd": float(sd), "fresh_trials": int(trials)}
            best["evaluation"] = evaluation.name
    return best
