"""Claims are decided by the values of missions, and refuse what no mission could show."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.measure.function import Function
from evoros.measure.protocol import Measure
from evoros.mission.mission import COMPLETED, LOST, TIME_LIMIT, Outcome
from evoros.requirement.bets import BETS
from evoros.requirement.claim import Claim
from evoros.requirement.requirements import check_requirements, collect
from evoros.requirement.verdict import MET, UNDECIDED, VIOLATED, Trial
from evoros.testing.subjects import example_outcome

WORLD = "hall"


def outcome(completed: bool, time_s: float = 50.0, **fields: Any) -> Outcome:
    ended = COMPLETED if completed else TIME_LIMIT
    made = example_outcome(1.0 if completed else 0.5, ended)
    return replace(made, completed=completed, time_s=time_s, **fields)


def trials(outcomes: Sequence[Outcome]) -> Mapping[int, Trial]:
    return {100 + index: {WORLD: (one,)} for index, one in enumerate(outcomes)}


def unmeasured(part: Measure, trial: Trial) -> float:
    raise AssertionError("no measure is required")


def judge(claim: Claim, *outcomes: Outcome) -> tuple[str, int]:
    verdict = claim.judge(trials(outcomes), [], unmeasured)
    return verdict.result, verdict.trials


def capital_of_ones(count: int, limit: float) -> float:
    return sum(part * (1 + share * (1 / limit - 1)) ** count for share, part in BETS)


def test_a_share_is_met_violated_or_undecided() -> None:
    claim = Claim("completed", at_least=0.9)
    assert judge(claim, *[outcome(True)] * 100) == (MET, 36)  # the capital that all bets win
    assert [capital_of_ones(count, 0.9) >= 20 for count in (35, 36)] == [False, True]
    result, count = judge(claim, *[outcome(False)] * 100)
    assert result == VIOLATED
    assert count < 5
    assert judge(claim, outcome(True), outcome(False)) == (UNDECIDED, 2)


def test_a_quantile_is_a_share_of_missions_that_keep_the_limit() -> None:
    claim = Claim("completion_time_s", at_most=60.0, share=0.8)
    soon, late, never = outcome(True, 50.0), outcome(True, 70.0), outcome(False, 50.0)
    assert judge(claim, *[soon] * 100)[0] == MET
    assert judge(claim, *[late] * 100) == judge(claim, *[never] * 100)
    assert judge(claim, *[never] * 100)[0] == VIOLATED


def test_the_worst_mission_is_that_farthest_from_the_limit() -> None:
    claim = Claim("time_s", at_most=60.0, within=[0.0, 100.0])
    made = [outcome(True, time) for time in (50.0, 90.0, 10.0, 90.0)]
    assert claim.judge(trials(made), [], unmeasured).worst == (101, WORLD)


def test_a_mission_that_was_not_run_is_the_worst() -> None:
    lost = Outcome.failure(LOST, "its process ended", 60.0, 3)
    for claim in (Claim("collisions", at_most=0, share=0.9), Claim("progress", at_least=0.5)):
        assert judge(claim, *[lost] * 60)[0] == VIOLATED


def test_what_never_happened_is_infinite() -> None:
    never = outcome(True, first_collision_s=math.nan)
    assert judge(Claim("first_collision_s", at_least=30.0, share=0.9), *[never] * 60)[0] == MET


def test_a_measure_is_computed_for_each_trial() -> None:
    seen: list[Trial] = []

    def measured(part: Measure, trial: Trial) -> float:
        seen.append(trial)
        return 8.0

    claim = Claim(Function(lambda evaluated: 0.0, "parcels", [0.0, 10.0]), at_least=5.0)
    made = trials([outcome(True)] * 60)
    verdict = claim.judge(made, [], measured)
    assert (verdict.result, seen) == (MET, list(made.values()))
    assert verdict.value == pytest.approx(8.0)
    assert 5.0 <= verdict.low < 8.0 < verdict.high <= 10.0


@given(st.lists(st.floats(0, 200), min_size=1, max_size=40))
def test_bounds_enclose_the_mean_and_at_most_mirrors_at_least(times: list[float]) -> None:
    made = trials([outcome(True, time) for time in times])
    upper = Claim("time_s", at_most=60.0, within=[0.0, 200.0]).judge(made, [], unmeasured)
    lower = Claim("time_s", at_least=60.0, within=[0.0, 200.0]).judge(made, [], unmeasured)
    assert upper.low <= upper.value + 1e-3
    assert upper.value <= upper.high + 1e-3
    mirrored = {MET: VIOLATED, VIOLATED: MET, UNDECIDED: UNDECIDED}
    assert mirrored[upper.result] == lower.result
    assert (upper.low, upper.high) == pytest.approx((lower.low, lower.high), abs=1e-3)


REFUSED: list[tuple[Any, str]] = [
    ({"of": "completed"}, "must have either at_least or at_most; keep one of the two"),
    ({"of": "completed", "at_least": 0.5, "at_most": 0.9}, "must have either at_least or at_most"),
    (
        {"of": "completed", "at_least": 1.2},
        "the limit must be between 0 and 1, the bounds of the quantity, not 1.2",
    ),
    ({"of": "completed", "at_least": 1}, "the limit must be between 0 and 1"),
    ({"of": "time_s", "at_most": 60}, "must have share (of the missions in which time_s meets"),
    ({"of": "collisions", "at_most": 0, "share": 1.2}, "greater than 0 and less than 1"),
    ({"of": "completed", "at_least": 0.5, "confidence": 1.0}, "a number from 0.5 to 0.999"),
    ({"of": "completed", "at_lest": 0.5}, "may have only of, at_least"),
    ({"at_least": 0.5}, "must have the key of"),
    (0.9, "must be a mapping, as in {of: completed, at_least: 0.9}, not 0.9"),
    (None, "must be a mapping"),
    ({"survives": 0}, "survives: must be a positive integer, not 0"),
]


@pytest.mark.parametrize(("fields", "message"), REFUSED)
def test_claims_that_missions_cannot_show_are_refused(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as error:
        collect(mine=fields)
    assert str(error.value).startswith("requirements.mine: ")
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_claims_that_contradict_each_other_are_refused() -> None:
    fast = {"of": "time_s", "at_most": 30, "share": 0.6}
    slow = {"of": "time_s", "at_least": 40, "share": 0.6}
    with pytest.raises(InputError, match=r"requirements\.a and requirements\.b: cannot both be"):
        collect(a=fast, b=slow)
    assert len(collect(a=fast, b={**slow, "share": 0.3})) == 2
    assert len(collect(a=fast, b={**slow, "world": "maze"})) == 2
    with pytest.raises(InputError, match="cannot both be met"):
        collect(a={"of": "completed", "at_least": 0.9}, b={"of": "completed", "at_most": 0.5})


def test_a_claim_names_a_column_and_a_world_that_missions_have() -> None:
    with pytest.raises(
        InputError, match=r"requirements\.a\.of: must be a measure or one of .*spee"
    ):
        check_requirements({"a": Claim("speed", at_most=1.0, share=0.5)}, [WORLD], [])
    with pytest.raises(
        InputError, match=r"requirements\.a\.world: must be one of hall, not 'yard'"
    ):
        check_requirements({"a": Claim("completed", at_least=0.5, world="yard")}, [WORLD], [])
    check_requirements({"a": Claim("twin.completed", at_least=0.5)}, [WORLD], ["twin"])
