"""Scores the outcomes of a design's missions."""

import math
from collections.abc import Mapping, Sequence
from statistics import fmean, stdev

from evoros.base.combining import Combine, mean
from evoros.base.errors import InputError
from evoros.fitness.protocol import CombiningFitness, Fitness
from evoros.fitness.team import TeamFitness
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import NOT_RUN, Outcome


def compute_fitness(
    fitness: Fitness, missions: Sequence[Mission], outcomes: Mapping[MissionKey, Outcome]
) -> float:
    """Return the fitness of a design from the scores of its trials.

    Raises:
        InputError: a score is not a finite number.
    """
    return choose_combine(fitness)(score_trials(fitness, missions, outcomes))


def choose_combine(fitness: Fitness) -> Combine:
    """Return what makes one fitness of the scores of trials: the mean, unless it says otherwise."""
    own = fitness.fitness if isinstance(fitness, TeamFitness) else fitness
    return own.combine if isinstance(own, CombiningFitness) else mean


def score_trials(
    fitness: Fitness, missions: Sequence[Mission], outcomes: Mapping[MissionKey, Outcome]
) -> list[float]:
    """Return the score of each trial over its worlds, in the order of the missions.

    A trial with a mission that could not be run has the worst score, whatever its other missions
    reached.

    Raises:
        InputError: a score is not a finite number.
    """
    by_trial: dict[int, list[Outcome]] = {}
    for mission in missions:
        by_trial.setdefault(mission.trial, []).append(outcomes[mission.key])
    scores = [float(score_trial(fitness, trial)) for trial in by_trial.values()]
    if not all(map(math.isfinite, scores)):
        raise InputError(
            f"fitness: must score every trial with a finite number, not {scores}; correct "
            f"{type(fitness).__name__}"
        )
    return scores


def score_trial(fitness: Fitness, trial: Sequence[Outcome]) -> float:
    """Return the score of a trial; the worst one if a mission could not be run."""
    complete = all(outcome.ended not in NOT_RUN for outcome in trial)
    return fitness.score(trial) if complete else fitness.worst(trial)


FITNESS, FITNESS_MEAN = "fitness", "fitness_mean"


def name_score_columns(fitness: Fitness, worlds: Sequence[str]) -> list[str]:
    """Return the names of the columns of ``summarize_scores``."""
    other = [] if choose_combine(fitness) is mean else [FITNESS]
    by_world = [f"{world}_{measure}" for world in worlds for measure in ("completed", "progress")]
    return [*other, FITNESS_MEAN, "fitness_sd", "trials", *by_world]


def summarize_scores(
    fitness: Fitness, missions: Sequence[Mission], outcomes: Mapping[MissionKey, Outcome]
) -> dict[str, float]:
    """Summarize the missions of a design: fitness over its trials, and success in each world.

    The standard deviation is that of a sample (n - 1), and NaN for one trial. Each world has the
    share of completed missions and the mean progress. A fitness that is not the mean over the
    trials comes first.

    Raises:
        InputError: a score is not a finite number.
    """
    scores = score_trials(fitness, missions, outcomes)
    by_world: dict[str, list[Outcome]] = {}
    for mission in missions:
        by_world.setdefault(mission.world, []).append(outcomes[mission.key])
    combine = choose_combine(fitness)
    values = [
        *([] if combine is mean else [combine(scores)]),
        mean(scores),
        stdev(scores) if len(scores) > 1 else math.nan,
        len(scores),
    ]
    for in_world in by_world.values():
        values.append(fmean(outcome.completed for outcome in in_world))
        values.append(fmean(outcome.progress for outcome in in_world))
    return dict(zip(name_score_columns(fitness, list(by_world)), values, strict=True))
