import itertools
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import pytest
from fakes import OWN

from evoros.config import build, compose
from evoros.errors import InputError, RunStopped, SimulationError, WorkerLost
from evoros.evaluation import AHEAD, POLICIES, STOP, WORST, Plan, compute, fitness_of, trajectories
from evoros.experiment import Experiment
from evoros.outcome import LOST, Outcome
from evoros.types import Design

DESIGN = Design(())
WORLDS = ("a", "b")


@cache
def experiment() -> Experiment:
    return build(compose(["experiment=tiny", "executor=serial"], OWN))


@dataclass
class Broken:
    """A pool whose every call ends as told; counts how many calls wait."""

    error: Exception
    waiting: int = 0
    most: int = 0

    def submit(self, function: Any, /, *args: Any) -> "Future[Any]":
        future: Future[Any] = Future()
        future.set_exception(self.error)
        self.waiting += 1
        self.most = max(self.most, self.waiting)
        return future


@dataclass(frozen=True)
class ByTrial:
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
    values = {m.place: outcome(10.0**m.trial * (1 + (m.world == "b"))) for m in missions}
    assert fitness_of(ByTrial(), missions, values) == pytest.approx(3 * 111 / 3)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_score_that_is_no_number_is_refused(bad: float) -> None:
    missions = Plan(0, WORLDS, 1, 0, "generation").selection(0, 0, DESIGN)
    values = {mission.place: outcome(bad) for mission in missions}
    with pytest.raises(InputError, match="ByTrial"):
        fitness_of(ByTrial(), missions, values)


def test_what_was_not_flown_never_reaches_the_score() -> None:
    """It is NaN where nothing was measured, and would make the fitness NaN for ever."""
    missions = Plan(0, WORLDS, 2, 0, "generation").selection(0, 0, DESIGN)
    values = {mission.place: outcome(3.0) for mission in missions}
    lost = replace(Outcome.failure(LOST, "why", 10.0, 0), progress=float("nan"))
    values[missions[0].place] = lost
    assert fitness_of(ByTrial(), missions, values) == (-2.0 + 6.0) / 2


def test_who_meets_the_same_draws() -> None:
    for policy, generation in itertools.product(POLICIES, range(2)):
        plan = Plan(0, WORLDS, 2, 2, policy)
        first, second = (plan.selection(generation, i, DESIGN) for i in (1, 2))
        other = plan.selection(generation + 1, 1, DESIGN)
        same = [a.draws == b.draws for a, b in zip(first, second, strict=True)]
        again = [a.draws == b.draws for a, b in zip(first, other, strict=True)]
        assert set(same) == {policy != "individual"}
        assert set(again) == {policy == "run"}


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
    assert len({mission.place for mission in in_run}) == len(in_run)
    assert plan.validation(0, 1, DESIGN)[0].draws == plan.validation(7, 8, DESIGN)[0].draws


def test_lost_missions_stop_or_are_the_worst() -> None:
    missions = experiment().plan.selection(3, 4, DESIGN)
    for error in (WorkerLost("it hung"), ValueError("no\nluck")):
        with pytest.raises(RunStopped, match=r"design 4 in \w+, generation 3, trial 0: "):
            list(compute(experiment().task, missions, Broken(error), 1, STOP))
        flown = list(compute(experiment().task, missions, Broken(error), 1, WORST))
        assert {outcome.ended for _, outcome in flown} == {LOST}
        assert {outcome.progress for _, outcome in flown} == {0.0}
        assert len(flown) == len(missions)
        tracks = trajectories(experiment().task, missions, Broken(error), WORST)
        assert [len(track) for track in tracks] == [0] * len(missions)
        with pytest.raises(RunStopped):
            trajectories(experiment().task, missions, Broken(error), STOP)


@pytest.mark.parametrize("error", [InputError("bad"), SimulationError("odd")])
def test_errors_of_ours_are_never_recorded_as_lost(error: Exception) -> None:
    missions = experiment().plan.selection(0, 0, DESIGN)
    with pytest.raises(type(error)):
        list(compute(experiment().task, missions, Broken(error), 1, WORST))


@pytest.mark.parametrize("workers", [1, 3])
def test_only_a_few_missions_are_submitted_ahead(workers: int) -> None:
    missions = [m for i in range(30) for m in experiment().plan.selection(0, i, DESIGN)]
    pool = Broken(WorkerLost("gone"))
    for _ in compute(experiment().task, missions, pool, workers, WORST):
        pool.waiting -= 1
    assert pool.most <= workers * AHEAD + 1
