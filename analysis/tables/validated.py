"""The champions of runs, measured again: by the run itself, or by an evaluation."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import pandas as pd

from evoros.base.errors import InputError
from evoros.storage.mission_log import resume_command

from .designs import number
from .matching import champion_content, champion_genes, conditions, differing, scored_designs

if TYPE_CHECKING:
    from .records import Record, Scored
    from .study import Study

BY_EVALUATION, BY_RUN, BY_NOTHING = "evaluation", "run", ""
Table = tuple["Scored", pd.DataFrame]


def validations(study: "Study") -> pd.DataFrame:
    """A row for each finished run: how fit its champion is.

    ``run``, ``treatment``, ``seed``; ``recorded``, on the draws that selected it; ``validated``, on
    fresh ones under the run's own conditions, and ``validated_by`` whom. That is an evaluation
    where there is one (of several that with most trials), else the run, which flies few trials:
    ``fresh``, ``fresh_sd``, ``fresh_trials`` and ``evaluation``, its name, and ``in_run`` and
    ``in_run_trials``. With a confirmation all of them are of the confirming simulator.

    Raises:
        InputError: no run is finished.
    """
    tables = evaluated(study)
    return study.gather(lambda record: _validation(record, tables))


def under(study: "Study", name: str) -> pd.DataFrame:
    """A row for each finished run: the score of its champion under conditions common to all.

    ``run``, ``treatment``, ``seed``, and ``under NAME``: the mean fitness in the evaluations of
    that name or treatment, of several in that with most trials; NaN where it is in none.

    Raises:
        InputError: no finished evaluation is called so, it has scored no champion, or no run is
            finished.
    """
    tables = evaluated(study)
    named = [table for one, table in tables if name in (one.name, one.treatment)]
    if not named:
        known = dict.fromkeys(one.treatment for one, _ in tables)
        raise InputError(
            f"--under: must be what a finished evaluation differs in from the others, or its name, "
            f"not {name!r}; there is {', '.join(known) or 'none'}"
        )
    scores = pd.concat(named).sort_values("trials", kind="stable")
    means = dict(zip(scores["content"], scores["fitness_mean"], strict=True))

    def score(record: "Record") -> pd.DataFrame:
        _require_finished(record)
        return pd.DataFrame([{f"under {name}": means.get(champion_content(record), math.nan)}])

    runs = study.gather(score)
    if runs[f"under {name}"].isna().all():
        raise InputError(
            f"--under {name}: must have scored a champion of these runs, and has scored none; "
            f"type: evoros-evaluate designs=SWEEP ..."
        )
    return runs


def evaluated(study: "Study") -> list[Table]:
    """The finished evaluations and their designs; of others it is said that they are left out."""
    tables = []
    for one in study.evaluations:
        try:
            tables.append((one, scored_designs(one)))
        except InputError as error:
            study.leave_out(str(error))
    return tables


def validates(scored: "Scored", record: "Record") -> bool:
    """Whether an evaluation flew under the conditions of a run, as far as its champion meets them.

    A value that evolved is the design's, whatever either configuration says.
    """
    evolved = champion_genes(record)
    return set(differing(conditions(scored), conditions(record))) <= set(evolved)


def _require_finished(record: "Record") -> None:
    if not record.finished:
        raise InputError(
            f"{record.path}: must be a finished run, and its state is "
            f"{record.run.status.get('state')}; type: {resume_command(record.path)}"
        )


def _validation(record: "Record", tables: Sequence[Table]) -> pd.DataFrame:
    _require_finished(record)
    status, fresh = record.run.status, _fresh(record, tables)
    in_run = number(status.get("best_validated_fitness"))
    by = BY_EVALUATION if fresh else BY_NOTHING if math.isnan(in_run) else BY_RUN
    row = {
        "recorded": number(status.get("best_fitness")),
        "validated": fresh.get("fresh", in_run),
        "validated_by": by,
        "in_run": in_run,
        "in_run_trials": record.values.get("optimizer.validation_trials"),
        **dict.fromkeys(("fresh", "fresh_sd", "fresh_trials"), math.nan),
        "evaluation": "",
    }
    return pd.DataFrame([row | fresh])


def _fresh(record: "Record", tables: Sequence[Table]) -> dict[str, Any]:
    """What the evaluation with most trials says of the champion; nothing where there is none."""
    content, best = champion_content(record), dict[str, Any]()
    for scored, table in tables:
        rows = table[[each == content for each in table["content"]]]
        if rows.empty or not validates(scored, record):
            continue
        mean, sd, trials = rows.iloc[0][["fitness_mean", "fitness_sd", "trials"]]
        if not best or trials > best["fresh_trials"]:
            best = {"fresh": float(mean), "fresh_sd": float(sd), "fresh_trials": int(trials)}
            best["evaluation"] = scored.name
    return best
