"""Trials are a sample of the failure model, whichever procedure takes how many of them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from statistics import fmean, variance

import numpy as np
import pytest
from bundled_parts import configured, kinds
from helpers import USER_PARTS

from evoros.allocation.protocol import Allocation
from evoros.base.rng import generator
from evoros.config.compose import compose
from evoros.design.design import Design
from evoros.evolution.contest import Contest
from evoros.evolution.experiment import Experiment
from evoros.evolution.scores import Opposition
from evoros.failure.adversarial import AdversarialFailure
from evoros.failure.exhaustive import ExhaustiveFailure
from evoros.failure.protocol import (
    Case,
    Failure,
    Fault,
    SystematicFailure,
    draw_faults,
    make_faults,
)
from evoros.mission.mission import Mission
from evoros.mission.plan import POLICIES, Plan
from evoros.requirement.bets import count_to_proof
from evoros.robot.model import Robot
from evoros.testing.allocation import hold_contest

ALLOCATIONS = kinds("allocation")
SEEDS, DRAWS = 10, 300
DEVIATIONS = 4.5  # standard errors that a mean may be off; seeds are fixed
DESIGNS, GENERATIONS, WORLD = 4, 3, "plains"
VARIED = {"battery": ["failure.sd_wh=0.5"]}
Score = Callable[[Mission], float]


@cache
def find_experiment() -> Experiment:
    return compose(["experiment=tiny"], config_dir=USER_PARTS).build()


@cache
def find_robot() -> tuple[Design, Robot]:
    experiment = find_experiment()
    design = experiment.space.decode(experiment.space.middle)
    return design, experiment.members[0].with_design(design).robot


def rate(faults: Sequence[Fault]) -> float:
    """How well a robot does with these faults, from 0 to 1."""
    harm = sum(
        float((np.arange(1, fault.onset.size + 1) / (1 + fault.onset / 20)).sum())
        + sum(fault.trigger.values) / 1e4
        for fault in faults
    )
    return 1 / (1 + harm)


def score_missions(failure: Failure) -> Score:
    """Score missions by their faults; draws that were met before are not drawn again."""
    robot, known = find_robot()[1], dict[str, float]()

    def score(mission: Mission) -> float:
        if mission.conditions not in known:
            rng = generator(mission.draws, "failure")
            if mission.case is None:
                faults = draw_faults(failure, robot.describe_sensors(), rng)
            else:
                faults = make_faults(failure, mission.case, len(robot.mounts))
            known[mission.conditions] = rate(faults)
        return known[mission.conditions]

    return score


def draw_model(failure: Failure) -> list[float]:
    """The ratings of all cases of a model, or of many independent draws."""
    channels = find_robot()[1].describe_sensors()
    if isinstance(failure, SystematicFailure):
        every = range(failure.count_cases(channels.size))
        cases = [failure.state_case(channels.size, number) for number in every]
        return [rate(make_faults(failure, case, channels.size)) for case in cases]
    return [rate(failure.draw(channels, generator(f"{i}", "model"))) for i in range(DRAWS)]


def find_plan(failure: Failure, seed: int = 0, trials: int = 2, policy: str = "generation") -> Plan:
    experiment = replace(find_experiment(), failure=failure)
    plan = replace(experiment.plan, seed=seed, trials=trials, policy=policy, worlds=(WORLD,))
    return replace(plan, most_trials=16, validation_trials=5, most_validation_trials=9)


def live(allocation: Allocation, plan: Plan, score: Score) -> float:
    """The fitness over its life of one of several equal designs, which are never told apart."""
    lives: dict[int, list[float]] = {i: [] for i in range(DESIGNS)}
    for generation in range(GENERATIONS):
        contest = Contest(allocation, plan.trials, {i: list(life) for i, life in lives.items()})
        while wanted := contest.next_round():
            contest.add(
                {
                    i: list(
                        map(
                            score,
                            plan.selection(generation, i, find_robot()[0], trials, len(lives[i])),
                        )
                    )
                    for i, trials in wanted.items()
                }
            )
        for i, scores in contest.scores.items():
            lives[i] += scores
    return fmean(lives[0])


def choose(allocation: Allocation, plan: Plan, score: Score) -> float:
    """The fitness of one of several equal designs in a final choice."""

    def draw(i: int, trial: int) -> float:
        (mission,) = plan.final(9, i, find_robot()[0], range(trial, trial + 1))
        return score(mission)

    return hold_contest(allocation, 1, {i: [] for i in range(DESIGNS)}, draw).fitness()[0]


def report(plan: Plan, score: Score) -> Iterator[tuple[str, float]]:
    """Yield what each procedure says of the fitness, the rate or the certificate of a design."""
    design = find_robot()[0]
    for name, policy in product(ALLOCATIONS, POLICIES):
        if policy != "individual" or name in ("once", "lifelong"):  # which do not choose
            allocation = configured("allocation", name)
            yield f"{name} {policy}", live(allocation, replace(plan, policy=policy), score)
    for name in ALLOCATIONS:
        yield f"final choice by {name}", choose(configured("allocation", name), plan, score)
    for count in (1, 5, 8):
        validated = plan.validation(3, 7, design, count)
        yield f"validation of {count}", fmean(map(score, validated))
        evaluated = replace(plan, trials=count).evaluation(0, 0, design)
        yield f"evaluation of {count}", fmean(map(score, evaluated))
    yield "confirmation", fmean(map(score, plan.confirmation(1, 2, design)))


@pytest.mark.parametrize("name", kinds("failure"))
def test_the_expectation_of_what_is_reported_is_the_mean_over_the_model(name: str) -> None:
    """Whatever their order, cases that are met first must not stand for the others."""
    failure = configured("failure", name, *VARIED.get(name, ()))
    score, model = score_missions(failure), draw_model(failure)
    reports: dict[str, list[float]] = {}
    for seed in range(SEEDS):
        for procedure, value in report(find_plan(failure, seed), score):
            reports.setdefault(procedure, []).append(value)
    exact = isinstance(failure, SystematicFailure)
    error = 0.0 if exact else variance(model) / len(model)
    for procedure, values in reports.items():
        allowed = DEVIATIONS * (variance(values) / SEEDS + error) ** 0.5 + 1e-9
        assert abs(fmean(values) - fmean(model)) <= allowed, procedure


@pytest.mark.parametrize("policy", POLICIES)
@pytest.mark.parametrize("cycles", [1, 2])
def test_as_many_trials_as_cases_meet_each_once(policy: str, cycles: int) -> None:
    failure = ExhaustiveFailure(most=2, times_s=(0.0, 40.0))
    design, sensors = find_robot()[0], len(find_robot()[0].mounts)
    every = [failure.state_case(sensors, i) for i in range(failure.count_cases(sensors))]
    trials = cycles * len(every)
    plan = find_plan(failure, 3, trials, policy)
    plan = replace(plan, worlds=(WORLD, "boxes"), most_validation_trials=trials)
    procedures = [
        plan.selection(2, 1, design),
        plan.selection(2, 1, design, range(4, 4 + trials)),  # begins amid a cycle
        plan.confirmation(2, 1, design),
        plan.validation(2, 1, design, trials),
        plan.final(2, 1, design, range(trials)),
        plan.evaluation(0, 1, design),
    ]
    for missions in procedures[: 1 if policy == "individual" else None]:
        in_world = [mission.case for mission in missions if mission.world == WORLD]
        assert in_world == [mission.case for mission in missions if mission.world == "boxes"]
        whole = in_world if missions is not procedures[1] else in_world[len(every) - 4 :]
        whole = whole[: len(whole) // len(every) * len(every)]
        assert sorted(map(str, whole)) == sorted(map(str, every * (len(whole) // len(every))))


def test_designs_with_equally_many_sensors_meet_the_same_cases() -> None:
    plan = find_plan(ExhaustiveFailure(), 1, 9)
    mounts = find_robot()[0].mounts
    one, other, small = (Design(mounts[at : at + count]) for at, count in ((0, 3), (1, 3), (0, 2)))
    cases = [[m.case for m in plan.selection(4, i, d)] for i, d in enumerate((one, other, small))]
    assert cases[0] == cases[1] != cases[2]
    assert cases[0] != [mission.case for mission in plan.selection(5, 0, one)]
    assert all(case is not None and max(case.sensors, default=0) < 2 for case in cases[2])


# Requirements -----------------------------------------------------------------------------------


def find_needed(limit: float, confidence: float, most: int) -> list[int]:
    """After how many ones some zeros are a proof that the mean exceeds the limit, for 0, 1, ..."""
    needed = []
    for zeros in range(most + 1):
        values = np.concatenate([np.zeros(zeros), np.ones(most)])
        count = count_to_proof(values, limit, confidence)
        needed.append(count - zeros if count else most + 1)
    return needed


def compute_error(cases: int, ones: int, confidence: float, cycles: int) -> float:
    """The exact chance that dealt cases ever show their mean to exceed what it is.

    So many of the cases are completed and the others are not.
    """
    needed = find_needed(ones / cases, confidence, cases * cycles)
    chances, error = {(0, 0): 1.0}, 0.0  # by the ones so far, and those of this cycle
    for trial in range(cases * cycles):
        left = cases - trial % cases
        following: dict[tuple[int, int], float] = {}
        for (total, dealt), chance in chances.items():
            share = (ones - dealt) / left
            if share > 0 and total + 1 >= needed[trial - total]:
                error += chance * share
            for more, part in ((1, share), (0, 1 - share)):
                if part > 0 and not (more and total + 1 >= needed[trial - total]):
                    key = total + more, dealt + more if left > 1 else 0
                    following[key] = following.get(key, 0.0) + chance * part
        chances = following
    return error


@pytest.mark.parametrize("confidence", [0.5, 0.8, 0.95])
def test_sequential_tests_of_dealt_cases_keep_their_level(confidence: float) -> None:
    """Without replacement, sums spread less than with it, and so does the capital of bets.

    At any one number of trials its expectation is lower by Maclaurin's inequality, as Hoeffding
    (Probability inequalities for sums of bounded random variables, 1963, theorem 4) shows for
    convex functions of sums. For all numbers at once the chance is computed here.
    """
    for cases, cycles in ((2, 4), (3, 4), (7, 3), (12, 3), (40, 1)):
        for ones in range(1, cases):
            assert compute_error(cases, ones, confidence, cycles) <= 1 - confidence + 1e-12


def test_requirements_of_all_cases_are_rarely_wrong() -> None:
    """A limit at the mean over the cases is shown neither to be exceeded nor to be missed."""
    failure, trials, confidence, seeds = ExhaustiveFailure(most=2), 64, 0.9, 200
    score, limit = score_missions(failure), fmean(draw_model(failure))
    wrong = []
    for seed in range(seeds):
        missions = find_plan(failure, seed, trials).evaluation(0, 0, find_robot()[0])
        values = np.array(list(map(score, missions)))
        sides = (values, limit), (1 - values, 1 - limit)
        wrong.append([count_to_proof(*side, confidence) > 0 for side in sides])
    level = 1 - confidence
    allowed = level + 3 * (level * confidence / seeds) ** 0.5
    assert (np.mean(wrong, axis=0) <= allowed).all()


# Cases that evolve ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Ordered:
    """An adversary with the same cases in each generation, which keeps what it is told."""

    told: list[Mapping[int, Mapping[int, float]]]

    def list_cases(self) -> list[Case]:
        return [Case((number,), (0.0,)) for number in range(6)]

    def tell(self, scores: Mapping[int, Mapping[int, float]]) -> None:
        self.told.append(scores)


@pytest.mark.parametrize("name", ALLOCATIONS)
def test_evolved_cases_are_met_in_a_random_order_unless_all_meet_all(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[Mapping[int, Mapping[int, float]]] = []
    monkeypatch.setattr(AdversarialFailure, "start", lambda *_: Ordered(told))
    parts = {"failure": AdversarialFailure(), "allocation": configured("allocation", name)}
    opposition = Opposition(replace(find_experiment(), **parts))
    counts = np.zeros(6)
    for generation in range(300):
        cases = opposition.list_cases(generation)
        numbers = [case.sensors[0] for case in cases]
        assert sorted(numbers) == list(range(6))
        assert opposition.list_cases(generation) == cases
        opposition.tell({5: [float(number) for number in numbers[:3]], 6: []})
        assert told[-1] == {5: {number: number for number in numbers[:3]}, 6: {}}
        counts[numbers[0]] += 1
    if name == "once":
        assert counts[0] == 300
    else:  # chi-square with 5 degrees of freedom; the quantile of 0.9999
        assert ((counts - 50) ** 2 / 50).sum() < 25.7
