"""Scores of designs from mission outcomes."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import fmean, stdev

from evoros.base.checks import SCORE, Rule, ask
from evoros.base.combining import Combine, mean
from evoros.fitness.naming import FitnessName, name_fitness
from evoros.fitness.protocol import AdditiveFitness, CombiningFitness, Fitness
from evoros.mission.mission import NOT_RUN, Mission, MissionKey, Outcome, Outcomes, judge

FITNESS, FITNESS_MEAN = "fitness", "fitness_mean"


@dataclass(frozen=True)
class Scoring:
    """Scores trials by the mean fitness of the ``scored`` robots."""

    fitness: Fitness
    scored: tuple[int, ...] = (0,)  # indices of robots in a scenario

    @property
    def name(self) -> FitnessName:
        """The name of the fitness in figures."""
        name = name_fitness(self.fitness)
        several = ", mean over the robots" if len(self.scored) > 1 else ""
        return FitnessName(name.title + several, name.unit)

    @property
    def combine(self) -> Combine:
        """The function that combines trial scores: ``mean``, or the fitness function's method."""
        if isinstance(self.fitness, CombiningFitness):
            return partial(ask, FITNESS, self.fitness.combine, SCORE)
        return mean

    def bound_combined(
        self, scores: Sequence[float], limits: tuple[float, float], confidence: float
    ) -> tuple[float, float]:
        """Return the interval of a ``CombiningFitness``; NaN if unknown."""
        if not isinstance(self.fitness, CombiningFitness):
            return math.nan, math.nan
        low, high = self.fitness.bound_combined(scores, limits, confidence)
        return float(low), float(high)

    def score_trial(self, trial: Sequence[Outcomes]) -> float:
        """Return the score of a trial, or the worst score if a mission could not run."""
        complete = _is_complete(trial)
        return self._average(self.fitness.score if complete else self.fitness.worst, trial)

    def worst(self, trial: Sequence[Outcomes]) -> float:
        """Return the worst score of a trial, for missions that could not run."""
        return self._average(self.fitness.worst, trial)

    def _average(
        self, score: Callable[[Sequence[Outcome]], float], trial: Sequence[Outcomes]
    ) -> float:
        robots = ([outcomes[place] for outcomes in trial] for place in self.scored)
        return fmean(ask(FITNESS, score, SCORE, outcomes) for outcomes in robots)

    def score_missions(self, trial: Sequence[Outcomes]) -> list[float]:
        """Return a score per mission, with the trial's score as mean, or only the trial's score."""
        fitness = self.fitness
        if not isinstance(fitness, AdditiveFitness):
            return [self.score_trial(trial)]
        if not _is_complete(trial):
            return [self.score_trial(trial)] * len(trial)
        rule = Rule(
            f"a list of {len(trial)} finite numbers, one for each mission",
            lambda v: hasattr(v, "__len__") and [*map(SCORE.holds, v)] == [True] * len(trial),
        )
        robots = ([outcomes[place] for outcomes in trial] for place in self.scored)
        of_robots = (ask(FITNESS, fitness.score_missions, rule, outcomes) for outcomes in robots)
        return list(map(fmean, zip(*of_robots, strict=True)))

    def score_trials(
        self, missions: Sequence[Mission], outcomes: Mapping[MissionKey, Outcomes]
    ) -> list[float]:
        """Return the score of each trial, in the order of the missions."""
        return [float(self.score_trial(trial)) for trial in list_trials(missions, outcomes)]

    def compute_fitness(
        self, missions: Sequence[Mission], outcomes: Mapping[MissionKey, Outcomes]
    ) -> float:
        """Return the fitness of a design from its missions."""
        return self.combine(self.score_trials(missions, outcomes))

    def name_columns(self, worlds: Sequence[str]) -> list[str]:
        """Return the names of the columns in ``summarize``."""
        other = [] if self.combine is mean else [FITNESS]
        of_world = ("completed", "progress")
        by_world = [f"{world}_{measure}" for world in worlds for measure in of_world]
        return [*other, FITNESS_MEAN, "fitness_sd", "trials", *by_world]

    def summarize(
        self, missions: Sequence[Mission], outcomes: Mapping[MissionKey, Outcomes]
    ) -> dict[str, float]:
        """Summarize a design's missions: the fitness over trials, and the results in each world.

        Results are the completion rate and mean progress. One trial's standard deviation is NaN.
        """
        scores = self.score_trials(missions, outcomes)
        by_world: dict[str, list[Outcome]] = {}
        for mission in missions:
            by_world.setdefault(mission.world, []).append(judge(outcomes[mission.key]))
        values = [
            *([] if self.combine is mean else [self.combine(scores)]),
            mean(scores),
            stdev(scores) if len(scores) > 1 else math.nan,
            len(scores),
        ]
        for judged in by_world.values():
            values.append(fmean(outcome.completed for outcome in judged))
            values.append(fmean(outcome.progress for outcome in judged))
        return dict(zip(self.name_columns(list(by_world)), values, strict=True))


def _is_complete(trial: Sequence[Outcomes]) -> bool:
    return all(judge(outcomes).ended not in NOT_RUN for outcomes in trial)


def list_trials(
    missions: Sequence[Mission], outcomes: Mapping[MissionKey, Outcomes]
) -> list[list[Outcomes]]:
    """Return the outcomes by trial, in the order of the missions."""
    trials: dict[int, list[Outcomes]] = {}
    for mission in missions:
        trials.setdefault(mission.trial, []).append(outcomes[mission.key])
    return list(trials.values())
