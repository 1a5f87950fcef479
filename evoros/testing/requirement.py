"""Checks of designs against requirements, for tests of a robot's software."""

from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from evoros.base.errors import InputError
from evoros.measure.protocol import Measure
from evoros.mission.mission import Outcomes
from evoros.requirement.requirements import (
    check_requirements,
    collect,
    list_levels,
    need_conditions,
)
from evoros.requirement.verdict import MET, Trial, Verdict, conclude
from evoros.storage.reading import ScoredDesigns
from evoros.storage.tables import OUTCOME_COLUMNS, cell, read_outcomes


def require(missions: pd.DataFrame, **requirements: float | Mapping[str, Any]) -> None:
    """Raise an AssertionError unless the missions of each design meet requirements.

    ``missions`` is the result of ``evoros.evaluate``, the table ``evoros.Evaluator.missions``, or
    the table from a ``missions.csv``. A requirement is a mapping, as in ``requirements`` of a
    configuration, or the minimum mean of the column with the requirement's name:
    ``require(evoros.evaluate(...), completed=0.95)``.

    Raises:
        AssertionError: a claim is violated, or the missions do not decide it.
        InputError: there are no missions or no requirements, or the missions lack a claim's
            quantity.
    """
    if not requirements:
        raise InputError("require: no requirements are given; add one, such as completed=0.95")
    if isinstance(missions, ScoredDesigns):
        missions = missions.missions
    if "world" not in missions:
        raise InputError(
            "missions: must be a table of missions or the result of evoros.evaluate, but has no "
            "column world"
        )
    if missions.empty:
        raise InputError("missions: the table is empty; run at least one mission")
    fields = {
        name: value if isinstance(value, Mapping) else {"of": name, "at_least": value}
        for name, value in requirements.items()
    }
    claims = collect(**fields)
    last = f".{OUTCOME_COLUMNS[0]}"  # suffix of the first column of each agent
    agents = [name.removesuffix(last) for name in missions.columns if name.endswith(last)]
    worlds = sorted(set(missions["world"]))
    check_requirements(claims, worlds, agents)
    if any(map(need_conditions, claims.values())):
        raise InputError(
            "require: the missions were not run at the levels of a requirement; check it with "
            "evoros evaluate"
        )
    problems = [
        f"design {design} {verdict.result}: {claims[name].text}; {verdict.text}"
        for design, of_design in missions.groupby("design", sort=False)
        for name, verdict in _judge(of_design, claims, worlds, agents)
        if verdict.result != MET
    ]
    assert not problems, "\n".join(problems)


def _judge(
    missions: pd.DataFrame, claims: Mapping[str, Any], worlds: list[str], agents: list[str]
) -> Iterator[tuple[str, Verdict]]:
    trials: dict[int, dict[str, Outcomes]] = {}
    for row in missions.sort_values("trial", kind="stable").to_dict("records"):
        cells = {str(name): cell(value) for name, value in row.items()}
        trials.setdefault(row["trial"], {})[row["world"]] = read_outcomes(cells, agents)
    for name, claim in claims.items():
        levels = list_levels(claim, worlds)
        judged = {
            level.text: level.claim.judge(trials, agents, _refuse, len(levels)) for level in levels
        }
        yield name, conclude(judged)


def _refuse(measure: Measure, trial: Trial) -> float:
    raise InputError(
        f"of: must be a column of the missions table, not the measure {measure.title!r}, which "
        f"also needs the design; check it with evoros evaluate"
    )
