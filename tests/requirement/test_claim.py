"""Claims are decided by values of missions, and bets show what they may at their error rate."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.measure.function import Function
from evoros.measure.protocol import Measure
from evoros.mission.mission import COMPLETED, LOST, TIME_LIMIT, Outcome
from evoros.requirement.bets import BETS, bound_from_below, count_to_proof, estimate_further
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
    ({"of": "time_s", "at_most": 60}, "must have either share (the fraction of missions in"),
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


CONFIDENCE = 0.95
VALUES = st.lists(st.floats(0, 1), max_size=60).map(np.array)
LIMITS = st.floats(0.01, 0.99)


def chance_of_proof(rate: float, limit: float, most: int) -> float:
    """The exact chance that successes at a rate show within so many trials that it is higher.

    The capital depends on the number of successes alone, so that its states are a line.
    """
    alive, proven = np.array([1.0]), 0.0
    for count in range(1, most + 1):
        reached = np.zeros(count + 1)
        reached[1:] += alive * rate
        reached[:-1] += alive * (1 - rate)
        won = np.arange(count + 1)
        with np.errstate(all="ignore"):
            capital = sum(
                part
                * (1 + share * (1 / limit - 1)) ** won
                * np.where(share < 1, 1 - share, 0.0) ** (count - won)
                for share, part in BETS
            )
        proof = capital >= 1 / (1 - CONFIDENCE)
        proven += reached[proof].sum()
        alive = np.where(proof, 0.0, reached)
    return float(proven)


@pytest.mark.parametrize("limit", [0.05, 0.5, 0.8, 0.95, 0.99])
def test_a_rate_at_the_limit_is_rarely_shown_to_exceed_it(limit: float) -> None:
    wrong = chance_of_proof(limit, limit, 1000)
    assert 0.01 < wrong <= 1 - CONFIDENCE


def test_a_clear_yes_takes_tens_of_trials_and_a_clear_no_fewer() -> None:
    ones = np.ones(1000)
    assert count_to_proof(ones, 0.95, CONFIDENCE) < 80  # 59 are the fewest of any test
    assert chance_of_proof(0.99, 0.95, 300) > 0.9
    assert chance_of_proof(1 - 0.5, 1 - 0.95, 30) > 0.99  # that half is less than 0.95


@given(st.lists(st.booleans(), min_size=1, max_size=40), st.sampled_from([0.25, 0.5, 0.75]))
def test_the_capital_is_that_of_exact_arithmetic(won: list[bool], limit: float) -> None:
    """The limits are binary fractions, so that odds are exact."""
    capitals, expected = [Fraction(1)] * len(BETS), 0
    for count, one in enumerate(won, 1):
        gain = (1 if one else 0) / Fraction(limit) - 1
        capitals = [
            capital * (1 + Fraction(share) * gain)
            for capital, (share, _) in zip(capitals, BETS, strict=True)
        ]
        total = sum(
            capital * Fraction(part) for capital, (_, part) in zip(capitals, BETS, strict=True)
        )
        if total >= 1 / (1 - Fraction(CONFIDENCE)):
            expected = count
            break
    assert count_to_proof(np.array(won, dtype=float), limit, CONFIDENCE) == expected


@given(VALUES, LIMITS)
def test_the_bound_is_where_proofs_end(values: np.ndarray, limit: float) -> None:
    bound = bound_from_below(values, CONFIDENCE)
    assert 0 <= bound <= 1
    if abs(limit - bound) > 1e-5:
        assert (count_to_proof(values, limit, CONFIDENCE) > 0) == (limit < bound)


@given(VALUES, st.lists(st.floats(0, 1), max_size=20), LIMITS)
def test_a_proof_stands_whatever_follows(
    values: np.ndarray, more: list[float], limit: float
) -> None:
    count = count_to_proof(values, limit, CONFIDENCE)
    if count:
        again = np.concatenate([values[:count], more])
        assert count_to_proof(again, limit, CONFIDENCE) == count


def test_the_capital_is_shared_among_bets_that_can_be_paid() -> None:
    assert sum(part for _, part in BETS) == pytest.approx(1, abs=1e-12)
    assert all(0 < share <= 1 for share, _ in BETS)


@given(st.integers(1, 40), st.floats(0.1, 1), LIMITS)
def test_the_estimate_is_exact_if_further_values_are_the_same(
    seen: int, value: float, limit: float
) -> None:
    count = count_to_proof(np.full(300, value), limit, CONFIDENCE)
    if seen < count:
        assert estimate_further(np.full(seen, value), limit, CONFIDENCE) == count - seen


@given(st.lists(st.floats(0, 1), min_size=1, max_size=30))
def test_a_mean_at_the_limit_is_never_estimated_to_be_decided(values: list[float]) -> None:
    seen = np.array([*values, 0.2, 0.7])
    mean = float(seen.mean())
    assert estimate_further(seen, mean, CONFIDENCE) == math.inf
    assert estimate_further(1 - seen, 1 - mean, CONFIDENCE) == math.inf


def test_half_of_all_proofs_take_no_more_than_the_estimate() -> None:
    """Of 300 series of completions, each continued as long as the estimate from its rate says."""
    luck = np.random.default_rng(4)
    seen = np.repeat([0.0, 1.0], [7, 93])
    assert not count_to_proof(seen, 0.88, CONFIDENCE)
    further = int(estimate_further(seen, 0.88, CONFIDENCE))
    series = [np.concatenate([seen, luck.random(further) < 0.93]) for _ in range(300)]
    shown = sum(count_to_proof(values, 0.88, CONFIDENCE) > 0 for values in series)
    assert 0.5 <= shown / 300 <= 0.9
