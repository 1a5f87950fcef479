"""Scores the outcomes of a design's missions."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, stdev

from evoros.base.combining import Combine, mean
from evoros.base.errors import InputError
from evoros.fitness.naming import FitnessName, name_fitness
from evoros.fitness.protocol import CombiningFitness, Fitness
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import NOT_RUN, Outcome, Outcomes, judge

FITNESS, FITNESS_MEAN = "fitness", "fitness_mean"


@dataclass(frozen=True)
class Scoring:
    """Scores trials by the mean fitness of the ``scored`` robots."""

    fitness: Fitness
    scored: tuple[int, ...] = (0,)  # their places in a scenario

    @property
    def name(self) -> FitnessName:
        """Its name in figures."""
        name = name_fitness(self.fitness)
        several = ", mean of the robots" if len(self.scored) > 1 else ""
        return FitnessName(name.title + several, name.unit)

    @property
    def combine(self) -> Combine:
        """Makes one fitness of the scores of trials: the mean, unless the fitness has its own."""
        return self.fitness.combine if isinstance(self.fitness, CombiningFitness) else mean

    def score_trial(self, trial: Sequence[Outcomes]) -> float:
        """Return the score of a trial; the worst one if a mission could not be run."""
        complete = all(judge(outcomes).ended not in NOT_RUN for outcomes in trial)
        score: Callable[[Sequence[Outcome]], float]
        score = self.fitness.score if complete else self.fitness.worst
        return fmean(score([outcomes[place] for outcomes in trial]) for place in self.scored)

    def score_trials(
        self, missions: Sequence[Mission], outcomes: Mapping[MissionKey, Outcomes]
    ) -> list[float]:
        """Return the score of each trial over its worlds, in the order of the missions.

        A trial with a mission that could not be run has the worst score, whatever its other
        missions reached.

        Raises:
            InputError: a score is not a finite number.
        """
        scores = [float(self.score_trial(trial)) for trial in list_trials(missions, outcomes)]
        if not all(map(math.isfinite, scores)):
            raise InputError(
                f"fitness: must score every trial with a finite number, not {scores}; correct "
                f"{type(self.fitness).__name__}"
            )
        return scores

    def compute_fitness(
        self, missions: Sequence[Mission], outcomes: Mapping[MissionKey, Outcomes]
    ) -> float:
        """Return the fitness of a design from the scores of its trials."""
        return self.combine(self.score_trials(missions, outcomes))

    def name_columns(self, worlds: Sequence[str]) -> list[str]:
        """Return the names of the columns of ``summarize``."""
        other = [] if self.combine is mean else [FITNESS]
        of_world = ("completed", "progress")
        by_world = [f"{world}_{measure}" for world in worlds for measure in of_world]
        return [*other, FITNESS_MEAN, "fitness_sd", "trials", *by_world]

    def summarize(
        self, missions: Sequence[Mission], outcomes: Mapping[MissionKey, Outcomes]
    ) -> dict[str, float]:
        """Summarize the missions of a design: fitness over its trials, and success in each world.

        The standard deviation is a sample's (n - 1), and NaN for one trial. Each world has the
        share of completed missions and the mean progress. A fitness that is not the mean over
        the trials comes first.
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


def list_trials(
    missions: Sequence[Mission], outcomes: Mapping[MissionKey, Outcomes]
) -> list[list[Outcomes]]:
    """Return the outcomes of each trial, in the order of the missions."""
    trials: dict[int, list[Outcomes]] = {}
    for mission in missions:
        trials.setdefault(mission.trial, []).append(outcomes[mission.key])
    return list(trials.values())
