import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import pytest

from evoros.base.errors import InputError
from evoros.design.design import Design
from evoros.fitness.protocol import Fitness
from evoros.fitness.scoring import Scoring
from evoros.mission.mission import LOST, Outcome
from evoros.mission.plan import (
    CONFIRMATION,
    EVALUATION,
    POLICIES,
    SELECTION,
    VALIDATION,
    Plan,
    count_round,
)

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
                for mission in plan.missions(purpose, generation, 1, DESIGN)
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
