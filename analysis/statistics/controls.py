"""Champions and their controls on the same random draws."""

from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from evoros.base.errors import InputError
from evoros.certificate.controls import NO_SENSORS, RANDOM
from evoros.storage.layout import CONTROLS, EVALUATION

from ..tables.paired_missions import CHAMPION, COMPLETED, QUANTITIES, read_missions
from ..tables.records import Record, read_record
from ..tables.study import Study
from .regression import ALL_WORLDS, compare_missions
from .small_samples import mean_interval

TITLES = {NO_SENSORS: "no sensors", RANDOM: "random search"}
DECIDES = {NO_SENSORS: "the sensors", RANDOM: "the search"}
"""Control -> what matters if the control is worse than the champion."""
LITTLE = 0.9
"""A control shown to complete this share of the champion's missions decides little."""
SHARES = ("control_completed", "champion_completed")
FITNESS = ("control_fitness", "champion_fitness")
CHANGE = ("difference", "low", "high")


def compare_controls(study: Study) -> pd.DataFrame:
    """Compare each finished run's champion with its controls: one row per run and control.

    ``difference`` is the champion's completion rate minus the control's, with an interval over the
    trials, whose draws are the same; the fitness columns are means over the trials.
    """
    recorded = [record for record in study.records if (record.path / CONTROLS).is_dir()]
    if not recorded:
        raise InputError(
            "controls: no run has been compared with any; type: evoros resume RUN controls=all"
        )
    return study.keep(recorded).gather(_compare)


def _compare(record: Record) -> pd.DataFrame:
    evaluation = read_record(record.path / CONTROLS / EVALUATION, record.name)
    evaluation.require_finished()
    missions = read_missions(evaluation)
    names = missions["source"].where(missions["source"].isin([CHAMPION, *TITLES]))
    missions["design"] = names.fillna(missions["source"] + " " + missions["design"])
    is_champion = missions["design"] == CHAMPION
    columns = ["world", "trial", *QUANTITIES]
    pairs = missions[~is_champion].merge(
        missions.loc[is_champion, columns], on=["world", "trial"], suffixes=("_a", "_b")
    )
    tests = compare_missions(pairs, [COMPLETED])
    tests = tests[tests["world"] == ALL_WORLDS].set_index("design")
    scores = evaluation.run.designs
    scores = scores.assign(fitness=scores.get("fitness", scores["fitness_mean"]))
    fitness = dict(zip(_name_rows(scores), scores["fitness"], strict=True))
    order = [name for name in fitness if name != CHAMPION]
    tests = tests.loc[order]
    return pd.DataFrame(
        {
            "control": order,
            "missions": tests["missions"].to_numpy(),
            "control_completed": tests["mean_a"].to_numpy(),
            "champion_completed": tests["mean_b"].to_numpy(),
            **{name: tests[name].to_numpy() for name in CHANGE},
            "control_fitness": [fitness[name] for name in order],
            "champion_fitness": fitness[CHAMPION],
        }
    )


def _name_rows(scores: pd.DataFrame) -> Iterator[str]:
    for source, design in zip(scores["source"], scores["design"].astype(str), strict=True):
        yield source if source in (CHAMPION, *TITLES) else f"{source} {design}"


def summarize_controls(table: pd.DataFrame) -> pd.DataFrame:
    """Average over the runs of each treatment; the interval of several runs is over the runs."""
    rows = []
    for (treatment, control), runs in table.groupby(["treatment", "control"], sort=False):
        means = runs[[*SHARES, *FITNESS, *CHANGE]].mean().to_dict()
        if len(runs) > 1:
            change = mean_interval(runs["difference"].to_numpy(float))
            means |= {"low": change.low, "high": change.high}
        rows.append({"treatment": treatment, "control": control, "runs": len(runs), **means})
    return pd.DataFrame(rows)


def describe_controls(summary: pd.DataFrame, label: str) -> list[str]:
    """Return a sentence for each row of ``summarize_controls``; ``label`` names the fitness."""
    several = summary["treatment"].nunique() > 1
    rows = summary.to_dict("records")
    return [f"{row['treatment']}, " * several + _describe_control(row, label) for row in rows]


def _describe_control(row: Mapping[Any, Any], label: str) -> str:
    control, champion = (100 * float(row[name]) for name in SHARES)
    low, high = (100 * row[name] for name in ("low", "high"))
    text = (
        f"{TITLES.get(row['control'], row['control'])}: completes {control:.0f} %, the champion "
        f"{champion:.0f} % (95 % interval of the difference {low:.0f} to {high:.0f} points); "
        f"{label} {row['control_fitness']:.3g}, the champion's {row['champion_fitness']:.3g}"
    )
    if not champion:
        return f"{text}; the champion completes none, so this decides nothing"
    if high <= (1 - LITTLE) * champion:
        return f"{text}; {DECIDES.get(row['control'], 'the search')} decided little here"
    return text if low > 0 else f"{text}; no evidence that the champion is better"
