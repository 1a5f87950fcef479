"""Converts missions to and from CSV, and generations and trajectories to CSV.

Numbers have full precision (``repr``), unmeasured values are empty, semicolons separate items.
"""

import csv
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any, get_type_hints

from evoros.base.arrays import Array
from evoros.mission.mission import Mission, MissionKey, Outcome, Outcomes

if TYPE_CHECKING:  # reading a table must not import the code of missions
    from evoros.evolution.journal import Generation
    from evoros.mission.scenario import Scenario

MISSION_COLUMNS = ("generation", "design", "world", "trial", "purpose", "draws")
GIVEN_COLUMNS = ("source", "design", "world", "trial", "draws")  # missions.csv begins with these
CANDIDATE_COLUMNS = ("generation", "id", "parents", "operator", "survived", "fitness", "trials")
VALIDATED, SCREENED, LOSS = "validated_fitness", "screened_fitness", "loss"
MEASURED_COLUMNS = (VALIDATED, SCREENED, LOSS)  # the last two exist only with a confirmation
AGENT = "agent"  # column with the name of an agent
WHOLE_COLUMNS = ("mode", "visited", "contact", "touched_by")  # integer columns of trajectories

_TYPES = get_type_hints(Outcome)
PART_COLUMNS = ("failed_parts", "parts_failed_at_s", "parts_failed_by")  # if other parts can fail
TOUCHED = "touched_walkers"  # additional column if missions can have walkers
SHORTEST = "shortest_m"  # additional column if a world states the length of its shortest path
FURTHER_COLUMNS = (*PART_COLUMNS, TOUCHED, SHORTEST)
OUTCOME_COLUMNS = tuple(
    field.name for field in fields(Outcome) if field.name not in FURTHER_COLUMNS
)
CASE = "case"  # last column if missions have stated failure cases


def list_further(parts: bool, walkers: bool, shortest: bool) -> tuple[str, ...]:
    """List the additional columns on failed parts, touched walkers and the shortest path."""
    return (*PART_COLUMNS * parts, *[TOUCHED] * walkers, *[SHORTEST] * shortest)


def list_further_in(scenario: "Scenario", parts: bool = False) -> tuple[str, ...]:
    """List a scenario's additional mission columns, with those on failed parts if ``parts``."""
    parts = parts or bool(scenario.failure.parts)
    return list_further(parts, scenario.any_walkers, scenario.states_shortest)


def name_outcome_columns(agents: Iterable[str], further: Sequence[str] = ()) -> list[str]:
    """Return the columns of all robots' outcomes; ``further`` comes from ``list_further``."""
    columns = (*OUTCOME_COLUMNS, *further)
    return [prefix + column for prefix in _prefixes(agents) for column in columns]


def _prefixes(agents: Iterable[str]) -> list[str]:
    return ["", *(f"{agent}." for agent in agents)]


def to_csv(rows: Iterable[Sequence[object]]) -> str:
    """Return the rows as CSV."""
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows([cell(v) for v in row] for row in rows)
    return buffer.getvalue()


def cell(value: object) -> str:
    """Format a value as a cell."""
    if isinstance(value, tuple | list):
        return ";".join(map(cell, value))
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return "" if math.isnan(value) else repr(float(value))
    return "" if value is None else str(value)


def mission_row(mission: Mission, outcomes: Outcomes, further: Sequence[str] = ()) -> list[object]:
    """Return the cells of a mission in ``missions.csv``, except its failure case."""
    return [*mission.key, mission.purpose, mission.draws, *outcome_cells(outcomes, further)]


def outcome_cells(outcomes: Outcomes, further: Sequence[str] = ()) -> list[object]:
    """Return the cells for all robots' outcomes."""
    columns = (*OUTCOME_COLUMNS, *further)
    return [getattr(outcome, name) for outcome in outcomes for name in columns]


def list_further_of(parts: bool, outcomes: Outcomes) -> tuple[str, ...]:
    """List the additional columns for a mission's outcomes."""
    walkers = any(outcome.touched_walkers is not None for outcome in outcomes)
    return list_further(parts, walkers, any(one.shortest_m is not None for one in outcomes))


def read_key(row: Mapping[str, str]) -> MissionKey:
    """Read a mission's key from a row."""
    return int(row["generation"]), int(row["design"]), row["world"], int(row["trial"])


def read_outcomes(row: Mapping[str, str], agents: Sequence[str] = ()) -> Outcomes:
    """Read the outcomes of all robots from a row written by ``outcome_cells``."""
    columns = (*OUTCOME_COLUMNS, *(PART_COLUMNS if PART_COLUMNS[0] in row else ()))
    return tuple(
        Outcome(
            **{name: _parse(row[prefix + name], _TYPES[name]) for name in columns},
            touched_walkers=_parse(row[prefix + TOUCHED], tuple[str])
            if prefix + TOUCHED in row
            else None,
            shortest_m=_parse(row[prefix + SHORTEST], float) if prefix + SHORTEST in row else None,
        )
        for prefix in _prefixes(agents)
    )


def are_recorded(outcomes: Outcomes, recorded: Outcomes, agents: Sequence[str]) -> bool:
    """Return True if outcomes equal the recorded outcomes once written and read."""
    further = list_further_of(True, outcomes)
    columns = name_outcome_columns(agents, further)
    cells = map(cell, outcome_cells(outcomes, further))
    again = read_outcomes(dict(zip(columns, cells, strict=True)), agents)
    return to_csv([outcome_cells(again, further)]) == to_csv([outcome_cells(recorded, further)])


def _parse(content: str, kind: Any) -> Any:
    if kind is str:
        return content
    if kind is bool:
        return {"true": True, "false": False}[content]
    if kind is float:
        return float(content) if content else math.nan
    if kind is int:
        return int(content)
    inner = kind.__args__[0]
    return tuple(_parse(item, inner) for item in content.split(";")) if content else ()


def generation_table(generation: "Generation") -> str:
    """Return ``generations/NNNNN.csv``, with a row per candidate."""
    measured = {VALIDATED: generation.validated_fitness}
    if generation.screened_fitness:
        measured |= {SCREENED: generation.screened_fitness, LOSS: generation.losses}
    pairs = zip(generation.measures, generation.genes, strict=True)
    values = [{**measures, **genes} for measures, genes in pairs]
    names = list(values[0]) if values else []
    rows: list[Sequence[object]] = [(*CANDIDATE_COLUMNS, *measured, *names)]
    for candidate, cells in zip(generation.candidates, values, strict=True):
        individual = candidate.individual
        row = [generation.number, individual.id, individual.parents, candidate.operator]
        row += [candidate.survived, candidate.fitness, generation.trials[individual.id]]
        row += [fitness.get(individual.id, math.nan) for fitness in measured.values()]
        rows.append([*row, *(cells[name] for name in names)])
    return to_csv(rows)


def trajectory_table(trajectory: Array, columns: Sequence[str]) -> str:
    """Return a trajectory with these columns as CSV."""
    whole = {i for i, name in enumerate(columns) if name.rpartition(".")[2] in WHOLE_COLUMNS}
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(columns)
    for row in trajectory.tolist():  # the fast writer formats floats and None as ``cell`` does
        numbers = [None if math.isnan(value) else value for value in row]
        writer.writerow(
            [int(v) if i in whole and v is not None else v for i, v in enumerate(numbers)]
        )
    return buffer.getvalue()
