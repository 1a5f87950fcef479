"""Designs that were scored under two conditions, by evaluations or by runs with a confirmation."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from math import nan
from typing import TYPE_CHECKING, Any

import pandas as pd

from evoros.base.errors import InputError

from .matching import champion_content, conditions, differing
from .treatments import ALONE, labels
from .validated import evaluated

if TYPE_CHECKING:
    from .records import Record
    from .study import Study

COLUMNS = (
    *("between", "x", "y", "group", "source", "design"),
    *("x_fitness", "x_sd", "x_trials", "y_fitness", "y_sd", "y_trials", "loss"),
)
CONFIRMING = "confirmation.simulator."
Values = Mapping[str, Any]
Row = dict[str, Any]


def scored_twice(study: "Study", between: str | None = None) -> pd.DataFrame:
    """A row for each design that was scored under two conditions.

    They are those of evaluations that differ in one part, such as the simulator (``between``), or
    in whatever the only two differ in; else those of the simulators of runs with a confirmation.
    ``x`` and ``y`` name them, and ``group`` what else differs among the evaluations; where nothing
    does, the treatment of the design's run. ``loss`` is what ``x_fitness`` has more than
    ``y_fitness``. Of a design scored several times under the same conditions that row stays which
    is of most trials.

    Raises:
        InputError: no design was scored twice, or there is a choice of ``between``.
    """
    rows = list(_evaluations(study)) or list(_confirmations(study))
    kinds = list(dict.fromkeys(str(row["between"]) for row in rows))
    if not kinds:
        raise InputError(
            "no design was scored twice: give two finished evaluations of the same designs that "
            "differ in one part (simulator, failure, world ...), or runs with a confirmation"
        )
    if between not in (None, *kinds) or (between is None and len(kinds) > 1):
        raise InputError(
            f"--between: must be one of {', '.join(kinds)}, in which the evaluations differ, not "
            f"{between or 'left out'}; choose one"
        )
    table = pd.DataFrame([row for row in rows if row["between"] == (between or kinds[0])])
    table = table.assign(trials=table[["x_trials", "y_trials"]].min(axis=1), order=table.index)
    best = table.sort_values("trials", ascending=False, kind="stable")
    best = best.drop_duplicates(["x", "y", "group", "content"]).sort_values("order")
    return best.assign(loss=best["x_fitness"] - best["y_fitness"])[list(COLUMNS)]


def _evaluations(study: "Study") -> Iterator[Row]:
    """The designs that two evaluations share whose conditions differ in one part."""
    tables = evaluated(study) if len(study.evaluations) > 1 else []
    each = [conditions(one) for one, _ in tables]
    origin = _treatments(study)
    for (i, left), (j, right) in combinations(enumerate(table for _, table in tables), 2):
        parts = list(dict.fromkeys(_part(key) for key in differing(each[i], each[j])))
        if len(parts) != 1 and len(tables) > 2:
            continue
        names = labels([_only(values, parts) for values in each])
        others = labels([_only(values, set(map(_part, values)) - set(parts)) for values in each])
        if not parts:  # other draws, then, or other trials
            names = [one.name for one, _ in tables]
        if names.index(names[i]) > names.index(names[j]):  # so that all pairs have the same axes
            i, j, left, right = j, i, right, left
        known = {row["content"]: row for row in right.to_dict("records")}
        for row in left.drop_duplicates("content").to_dict("records"):
            if row["content"] in known:
                yield {
                    **{"between": " and ".join(parts) or "draws", "x": names[i], "y": names[j]},
                    "group": origin.get(row["content"], "") if others[i] == ALONE else others[i],
                    **{name: row[name] for name in ("content", "source", "design")},
                    **_scores("x", row),
                    **_scores("y", known[row["content"]]),
                }


def _scores(side: str, row: Mapping[Any, Any]) -> Row:
    names = {"fitness": "fitness_mean", "sd": "fitness_sd", "trials": "trials"}
    return {f"{side}_{short}": row[name] for short, name in names.items()}


def _treatments(study: "Study") -> dict[Any, str]:
    """Of the champions of runs that are there, too."""
    found = {}
    for record in study.records:
        try:
            found[champion_content(record)] = record.treatment
        except InputError:
            continue  # not finished: nothing of it is drawn here
    return found


def _confirmations(study: "Study") -> Iterator[Row]:
    confirmed = [one for one in study.records if f"{CONFIRMING}_target_" in one.values]
    if confirmed:
        table = replace(study, records=tuple(confirmed)).gather(_confirmed)
        yield from ({str(k): v for k, v in row.items()} for row in table.to_dict("records"))


def _confirmed(record: "Record") -> pd.DataFrame:
    """The designs of a run that were confirmed."""
    table = record.run.generations
    if table.empty:
        raise InputError(f"{record.path}: must have a generation, and has none; resume the run")
    found = table[table["loss"].notna()].drop_duplicates("id")
    own = _only(record.values, {"simulator"})
    confirming = _only(conditions(record), {"simulator"})
    x, y = labels([own, confirming])
    return pd.DataFrame(
        {
            **{"between": "simulator", "x": x, "y": y, "group": record.treatment},
            **{"source": record.name, "design": found["id"]},
            "content": [(record.name, number) for number in found["id"]],
            **{"x_fitness": found["screened_fitness"], "y_fitness": found["fitness"]},
            **{"x_sd": nan, "y_sd": nan},
            **dict.fromkeys(("x_trials", "y_trials"), record.values.get("trials")),
        }
    )


def _part(key: str) -> str:
    return key.split(".")[0]


def _only(values: Values, parts: Sequence[str] | set[str]) -> dict[str, Any]:
    return {key: value for key, value in values.items() if _part(key) in parts}
