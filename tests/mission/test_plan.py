import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.failure.exhaustive import ExhaustiveFailure
from evoros.failure.protocol import Fault
from evoros.filter.silence import Silence
from evoros.fitness.protocol import Fitness
from evoros.fitness.scoring import Scoring
from evoros.mission.metrics import compute_progress, list_failures
from evoros.mission.mission import LOST, Outcome
from evoros.mission.plan import (
    CONFIRMATION,
    EVALUATION,
    GENERATIONS,
    POLICIES,
    SELECTION,
    TRIALS,
    VALIDATION,
    VALIDATION_TRIALS,
    Plan,
    count_growing,
    count_round,
    find_growing,
)
from evoros.sensor.protocol import Mount

DESIGN = Design(())
WORLDS = ("a", "b")


@dataclass(frozen=True)
class ByTrial(Fitness):
    """Scores a trial by the sum of the progress: the tests give each trial its own."""

    def score(self, outcomes: Sequence[Outcome]) -> float:
        return sum(outcome.progress for outcome in outcomes)

    def worst(self, outcomes: Sequence[Outcome]) -> float:
        return -1.0 * len(outcomes)


def outcome(progress: float) -> Outcome:
    empty = Outcome.failure("time_limit", "", 10.0, 0)
    return Outcome(**{**empty.__dict__, "progress": progress})


def test_fitness_is_the_mean_over_trials_of_the_score_over_worlds() -> None:
    missions = Plan(0, WORLDS, 3, 0, "generation").selection(0, 0, DESIGN)
    values = {m.key: (outcome(10.0**m.trial * (1 + (m.world == "b"))),) for m in missions}
    assert Scoring(ByTrial()).compute_fitness(missions, values) == pytest.approx(3 * 111 / 3)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_score_that_is_no_number_is_refused(bad: float) -> None:
    missions = Plan(0, WORLDS, 1, 0, "generation").selection(0, 0, DESIGN)
    values = {mission.key: (outcome(bad),) for mission in missions}
    with pytest.raises(InputError, match="ByTrial"):
        Scoring(ByTrial()).compute_fitness(missions, values)


def test_what_was_not_flown_never_reaches_the_score() -> None:
    """It is NaN where nothing was measured, and would make the fitness NaN for ever."""
    missions = Plan(0, WORLDS, 2, 0, "generation").selection(0, 0, DESIGN)
    values = {mission.key: (outcome(3.0),) for mission in missions}
    lost = replace(Outcome.failure(LOST, "why", 10.0, 0), progress=float("nan"))
    values[missions[0].key] = (lost,)
    assert Scoring(ByTrial()).compute_fitness(missions, values) == (-2.0 + 6.0) / 2


def test_who_meets_the_same_draws() -> None:
    for policy, generation in itertools.product(POLICIES, range(2)):
        plan = Plan(0, WORLDS, 2, 2, policy)
        first, second = (plan.selection(generation, i, DESIGN) for i in (1, 2))
        other = plan.selection(generation + 1, 1, DESIGN)
        same = [a.draws == b.draws for a, b in zip(first, second, strict=True)]
        again = [a.draws == b.draws for a, b in zip(first, other, strict=True)]
        assert set(same) == {policy != "individual"}
        assert set(again) == {policy == "run"}


def test_a_validation_is_the_same_round_for_every_generation_and_has_both_directions() -> None:
    plan = Plan(0, WORLDS, 1, 4, "generation")
    rounds = {
        purpose: [
            [
                count_round(mission.purpose, mission.generation, mission.trial)
                for mission in getattr(plan, purpose)(generation, 1, DESIGN)
                if mission.world == "a"
            ]
            for generation in range(3)
        ]
        for purpose in (SELECTION, CONFIRMATION, VALIDATION, EVALUATION)
    }
    assert rounds[SELECTION] == rounds[CONFIRMATION] == rounds[EVALUATION] == [[0], [1], [2]]
    assert rounds[VALIDATION] == [[1, 2, 3, 4]] * 3


@pytest.mark.parametrize("policy", POLICIES)
def test_no_draw_is_met_twice_by_a_design_or_for_two_purposes(policy: str) -> None:
    plan = Plan(5, WORLDS, 3, 4, policy)
    missions = [
        *plan.selection(2, 9, DESIGN),
        *plan.validation(2, 9, DESIGN),
        *plan.evaluation(2, 9, DESIGN),
    ]
    assert len({mission.draws for mission in missions}) == len(missions)
    in_run = [*plan.selection(2, 9, DESIGN), *plan.validation(2, 9, DESIGN)]
    assert len({mission.key for mission in in_run}) == len(in_run)
    assert plan.validation(0, 1, DESIGN)[0].draws == plan.validation(7, 8, DESIGN)[0].draws


@given(
    st.sampled_from(POLICIES), st.integers(1, 3), st.integers(0, 2), st.integers(0, 4),
    st.integers(0, 3),
)  # fmt: skip
def test_each_key_is_one_mission_and_each_draw_is_met_once_for_a_purpose(
    policy: str, trials: int, more: int, validated: int, further: int
) -> None:
    """A design gets more trials in its generation, survives, is confirmed and enters the final."""
    design = Design((Mount("sonar", "base", 0, 0, 0, 0, 0),) * 4)
    most = trials + more, validated + further
    plan = Plan(5, WORLDS, trials, validated, policy, *most, systematic=ExhaustiveFailure())
    generations = [(0, 0, range(trials)), (0, 0, range(trials, most[0]))]
    generations += [(1, most[0], range(1)), (1, most[0], range(1, trials))]
    selection = [
        mission
        for generation, earlier, numbers in generations
        for mission in plan.selection(generation, 9, design, numbers, earlier)
    ]
    confirmation = plan.confirmation(0, 9, design, range(most[0]))
    validation = plan.validation(0, 9, design, most[1])
    final = [one for i in range(2) for one in plan.final(0, 9, design, range(2 * i, 2 * i + 2))]
    assert [len(group) / 2 for group in (selection, validation, final)] == [
        most[0] + trials, most[1], 4
    ]  # fmt: skip
    every = [*selection, *confirmation, *validation, *final]
    assert len({mission.key for mission in every}) == len(every)
    assert [one.draws for one in confirmation] == [one.draws for one in selection[: 2 * most[0]]]
    for group in (selection, validation, final):
        assert len({mission.draws for mission in group}) == len(group)
        cases = [mission.case for mission in group if mission.world == "a"]
        if policy == "run" or group is not selection:  # otherwise each generation has a new deal
            assert len(set(cases)) == len(cases)


@pytest.mark.parametrize("draws", [EVALUATION, VALIDATION])
def test_an_evaluation_has_the_stated_trials(draws: str) -> None:
    plan = Plan(0, WORLDS, 3, 2, "run", evaluation_draws=draws, revalidation_trials=7)
    assert len(plan.evaluation(0, 1, DESIGN)) == 2 * plan.evaluation_trials


def test_a_growing_key_is_read_from_its_place() -> None:
    optimizer = {"generations": 7, "validation_trials": 2}
    values = {"trials": 3, "optimizer": optimizer, "validation": {"trials": 5}}
    counts = [count_growing(values, key) for key in (TRIALS, GENERATIONS, VALIDATION_TRIALS)]
    assert counts == [3, 7, 5]
    assert count_growing({**values, "validation": {"trials": None}}, VALIDATION_TRIALS) == 2
    assert find_growing(values) == TRIALS
    assert find_growing({**values, "evaluation_draws": VALIDATION}) == VALIDATION_TRIALS


ROUTE = np.array([[float(i), 0.0] for i in range(10)])


@given(st.integers(0, 9), st.floats(-50, 50), st.floats(-50, 50))
def test_progress_is_the_papers_for_ten_waypoints(visited: int, x: float, y: float) -> None:
    """10 for each waypoint, and 10 / max(distance - 1, 1) %, at most 99."""
    distance = math.dist((x, y), ROUTE[visited])
    percent = min(99.0, 10 * visited + 10 / max(distance - 1, 1))
    assert math.isclose(100 * compute_progress(np.array([x, y]), visited, ROUTE, 1.0), percent)


def test_progress_is_complete_only_at_the_end() -> None:
    assert compute_progress(ROUTE[9], 9, ROUTE, 1.0) == 0.99
    assert compute_progress(ROUTE[9], 10, ROUTE, 1.0) == 1.0


@given(st.lists(st.one_of(st.floats(0, 100), st.just(math.inf)), max_size=6), st.floats(0, 99))
def test_failures_are_those_that_began(onsets: list[float], end: float) -> None:
    failures = list_failures((Fault(Silence(), np.array(onsets)),), end)
    assert [index for index, _, _ in failures] == [i for i, at in enumerate(onsets) if at <= end]
    assert all(at == onsets[index] and effect == "silence" for index, at, effect in failures)


def test_a_lost_mission_has_done_nothing() -> None:
    lost = Outcome.failure(LOST, "two\nlines", 540.0, 6)
    assert (lost.ended, lost.reason, lost.time_limit_s, lost.sensors) == (
        "lost",
        "two lines",
        540.0,
        6,
    )
    assert (lost.progress, lost.time_s, lost.completed, lost.visited) == (0.0, 0.0, False, 0)
    assert math.isnan(lost.mean_speed_mps)
    assert lost.least_waypoint_distances_m == ()
