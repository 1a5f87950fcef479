import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import pytest
from bundled_parts import every, find_other_defaults
from hypothesis import given
from hypothesis import strategies as st

from evoros.design.design import Design
from evoros.fitness.equation_one import EquationOne, equation_one
from evoros.fitness.naming import FitnessName, bound_fitness, name_fitness
from evoros.fitness.protocol import Fitness
from evoros.fitness.scoring import Scoring
from evoros.fitness.worst_case import WorstCase
from evoros.mission.mission import COMPLETED, LOST, NOT_RUN, TIME_LIMIT, Mission, Outcome
from evoros.testing import FitnessSuite

LIMIT = 540.0
SHARE = st.floats(0.0, 1.0)


def outcome_of(progress: float, time: float = LIMIT, sensors: int = 0) -> Outcome:
    """The outcome of a mission that is completed if its progress is 1."""
    nothing = Outcome.failure(TIME_LIMIT, "", LIMIT, sensors)
    done = progress == 1.0
    ended = COMPLETED if done else TIME_LIMIT
    return replace(nothing, ended=ended, completed=done, progress=progress, time_s=time)


def test_equation_one_where_it_is_known() -> None:
    assert equation_one(outcome_of(0.0)) == 1.0
    assert equation_one(outcome_of(0.5)) == 2.25
    assert equation_one(outcome_of(1.0, time=0.0)) == 8.0
    assert equation_one(outcome_of(1.0, time=LIMIT)) == 5.0
    assert equation_one(outcome_of(1.0, time=LIMIT / 2)) == 4.0 + 1.5**2
    three = [outcome_of(1.0, time=360.0)] * 3  # a third of the time is left in each world
    assert EquationOne().score(three) == pytest.approx(3 * (4 + (4 / 3) ** 2))
    assert round(EquationOne().score(three), 1) == 17.3


@given(st.floats(0.0, 0.99), SHARE)
def test_equation_one_rises_with_progress_and_with_the_time_left(done: float, left: float) -> None:
    assert equation_one(outcome_of(done)) == pytest.approx((1 + done) ** 2)
    completed = equation_one(outcome_of(1.0, LIMIT * (1 - left)))
    assert completed == pytest.approx(4 + (1 + left) ** 2)
    assert 1.0 <= equation_one(outcome_of(done)) < 5.0 <= completed <= 8.0


@given(st.lists(SHARE, min_size=1, max_size=5), SHARE)
def test_no_score_is_beyond_the_bounds(done: list[float], left: float) -> None:
    fitness = WorstCase(EquationOne())
    low, high = bound_fitness(fitness, len(done))
    outcomes = [outcome_of(completed, LIMIT * (1 - left)) for completed in done]
    assert low <= fitness.score(outcomes) <= high
    assert fitness.worst(outcomes) == low
    assert fitness.score([outcome_of(1.0, time=0.0)] * len(done)) == high
    assert bound_fitness(EquationOne(price_weight=0.1), len(done)) == ()


@given(st.lists(SHARE, min_size=1, max_size=5), st.integers(0, 12))
def test_worlds_add_up_and_sensors_are_paid_for_once(done: list[float], sensors: int) -> None:
    outcomes = [outcome_of(completed, sensors=sensors) for completed in done]
    total = sum(map(equation_one, outcomes))
    assert EquationOne().score(outcomes) == total
    assert EquationOne(0.3).score(outcomes) == pytest.approx(total - 0.3 * sensors)


@given(SHARE, st.floats(0.0, 999.0), st.floats(0.0, 2.0))
def test_the_price_of_the_sensors_is_paid_once(done: float, price: float, weight: float) -> None:
    bought = [replace(outcome_of(done), price=price)] * 3
    free = [outcome_of(done)] * 3
    fitness, paid = EquationOne(), EquationOne(price_weight=weight)
    assert paid.score(bought) == pytest.approx(fitness.score(free) - weight * price)
    assert paid.worst(bought) == pytest.approx(fitness.worst(free) - weight * price)
    assert paid.score(free) == fitness.score(free)


def test_six_sensors_cost_1_8_in_the_original_runs() -> None:
    outcomes = [outcome_of(1.0, time=360.0, sensors=6)] * 3
    assert EquationOne(0.3).score(outcomes) == pytest.approx(EquationOne().score(outcomes) - 1.8)


@given(st.lists(SHARE, min_size=2, max_size=4), st.sampled_from(NOT_RUN), st.integers(0, 9))
def test_a_trial_with_a_mission_that_was_not_run_is_the_worst(
    done: list[float], ended: str, sensors: int
) -> None:
    """However well the others went: no better than nothing done in any world."""
    fitness: Fitness = EquationOne(0.3)
    worlds = [str(i) for i in range(len(done))]
    missions = [Mission(0, 0, Design(()), world, 0, "selection", world) for world in worlds]
    outcomes = [outcome_of(completed, time=0.0, sensors=sensors) for completed in done]
    nothing = [outcome_of(0.0, sensors=sensors) for _ in done]
    outcomes[0] = Outcome.failure(ended, "why", LIMIT, sensors)
    known = dict(zip([mission.key for mission in missions], zip(outcomes), strict=True))
    assert Scoring(fitness).compute_fitness(missions, known) == pytest.approx(
        fitness.score(nothing)
    )


def test_other_trials_of_such_a_design_still_count() -> None:
    missions = [Mission(0, 0, Design(()), "a", trial, "selection", "a") for trial in range(2)]
    outcomes = [Outcome.failure(LOST, "why", LIMIT, 0), outcome_of(1.0, time=0.0)]
    known = dict(zip([mission.key for mission in missions], zip(outcomes), strict=True))
    scoring = Scoring(EquationOne())
    assert scoring.compute_fitness(missions, known) == (1 + 8) / 2
    assert scoring.summarize(missions, known)["fitness_sd"] == pytest.approx(7 / math.sqrt(2))
    assert math.isnan(scoring.summarize(missions[:1], known)["fitness_sd"])


class TestBundledFitness(FitnessSuite):
    choose = every("fitness", bad_values={"worst_case": [{"share": x} for x in (0.0, 1.5, True)]})


def test_configurations_repeat_the_defaults() -> None:
    assert find_other_defaults("fitness") == []


@dataclass(frozen=True)
class CarefulURDFDriver2(Fitness):
    def score(self, outcomes: Sequence[Outcome]) -> float:
        return 0.0

    def worst(self, outcomes: Sequence[Outcome]) -> float:
        return 0.0


class PlanB(CarefulURDFDriver2):
    pass


@dataclass(frozen=True)
class Distance(CarefulURDFDriver2):
    title = "distance driven"
    unit = "m"


@pytest.mark.parametrize(
    ("fitness", "label"),
    [
        (Distance(), "distance driven [m]"),
        (CarefulURDFDriver2(), "fitness (careful URDF driver 2)"),
        (PlanB(), "fitness (plan b)"),
        (EquationOne(), "fitness (Eq. 1)"),
        (EquationOne(sensor_penalty=0.3), "fitness (Eq. 1 less penalties)"),
        (EquationOne(price_weight=0.1), "fitness (Eq. 1 less penalties)"),
        (WorstCase(Distance(), 0.25), "distance driven, mean of the lowest 25 % [m]"),
    ],
)
def test_the_label_has_title_and_unit(fitness: Fitness, label: str) -> None:
    assert name_fitness(fitness).label == label
    assert Scoring(fitness).name.label == label


def test_the_label_of_several_robots_names_their_mean() -> None:
    assert Scoring(Distance(), (0, 2)).name.label == "distance driven, mean over the robots [m]"


@pytest.mark.parametrize("fitness", [Distance(), CarefulURDFDriver2(), WorstCase(Distance())])
def test_only_equation_one_is_called_so(fitness: Fitness) -> None:
    assert "Eq" not in name_fitness(fitness).label


def test_an_unknown_fitness_has_the_word_alone() -> None:
    assert FitnessName().label == "fitness"
