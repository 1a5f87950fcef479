import csv
import io
import math
from dataclasses import fields, replace

from hypothesis import given
from hypothesis import strategies as st

from evoros.design.design import Design
from evoros.mission.mission import Mission, Outcome
from evoros.storage.tables import (
    MISSION_COLUMNS,
    cell,
    list_further,
    mission_row,
    name_outcome_columns,
    read_key,
    read_outcomes,
    to_csv,
)

FINITE = st.floats(allow_nan=False, allow_infinity=False)
# Reasons are one line; lists of effects hold names.
LINE = st.text(st.characters(exclude_categories=["Cs", "Cc", "Zl", "Zp"]), max_size=30)
NAME = st.from_regex(r"[a-z_]+", fullmatch=True)
KINDS: dict[object, st.SearchStrategy[object]] = {
    str: LINE,
    bool: st.booleans(),
    int: st.integers(0, 10**9),
    float: st.one_of(FINITE, st.just(math.nan)),
    tuple[float, ...]: st.lists(FINITE, max_size=4).map(tuple),
    tuple[int, ...]: st.lists(st.integers(0, 99), max_size=4).map(tuple),
    tuple[str, ...]: st.lists(NAME, max_size=4).map(tuple),
    tuple[str, ...] | None: st.lists(NAME, max_size=4).map(tuple),
    float | None: FINITE,
}
OUTCOMES = st.builds(Outcome, **{field.name: KINDS[field.type] for field in fields(Outcome)})


@given(
    st.lists(OUTCOMES, min_size=1, max_size=3),
    LINE.filter(bool),
    st.integers(0, 99),
    st.booleans(),
    st.booleans(),
)
def test_a_mission_read_back_is_the_one_that_was_written(
    outcomes: list[Outcome], world: str, generation: int, walkers: bool, shortest: bool
) -> None:
    if not walkers:
        outcomes = [replace(outcome, touched_walkers=None) for outcome in outcomes]
    outcomes = [replace(outcome, shortest_m=10.5 if shortest else None) for outcome in outcomes]
    agents = ("leader", "follower")[: len(outcomes) - 1]
    mission = Mission(generation, 7, Design(()), world, 2, "selection", f"0/{world}")
    further = list_further(True, walkers, shortest)
    header = [*MISSION_COLUMNS, *name_outcome_columns(agents, further)]
    written = to_csv([header, mission_row(mission, tuple(outcomes), further=further)])
    assert written.count("\n") == 2
    (row,) = csv.DictReader(io.StringIO(written, newline=""))
    place, back = read_key(row), read_outcomes(row, agents)
    assert (place, row["draws"]) == (mission.key, mission.draws)
    # repr: it tells NaN from a number, -0.0 from 0.0, and a tuple from its items
    assert repr(back) == repr(tuple(outcomes))


@given(FINITE)
def test_numbers_are_written_in_full(value: float) -> None:
    assert float(cell(value)) == value
