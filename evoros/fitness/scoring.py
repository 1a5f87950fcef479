"""Scores the outcomes of a design's missions."""

import math
from collections.abc import Mapping, Sequence
from statistics import fmean, stdev

from evoros.base.errors import InputError
from evoros.fitness.protocol import Fitness
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import NOT_RUN, Outcome


def compute_fitness(
    fitness: Fitness, missions: Sequence[Mission], outcomes: Mapping[MissionKey, Outcome]
) -> float:
    """Return the mean score of a design's trials.

    Raises:
        InputError: a score is not a finite number.
    """
    scores = score_trials(fitness, missions, outcomes)
    return sum(scores) / len(scores)


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


def name_score_columns(worlds: Sequence[str]) -> list[str]:
    """Return the names of the columns of ``summarize_scores``."""
    by_world = [f"{world}_{measure}" for world in worlds for measure in ("completed", "progress")]
    return ["fitness_mean", "fitness_sd", "trials", *by_world]


def summarize_scores(
    fitness: Fitness, missions: Sequence[Mission], outcomes: Mapping[MissionKey, Outcome]
) -> dict[str, float]:
    """Summarize the missions of a design: fitness over its trials, and success in each world.

    The standard deviation is that of a sample (n - 1), and NaN for one trial. Each world has the
    share of completed missions and the mean progress.

    Raises:
        InputError: a score is not a finite number.
    """
    scores = score_trials(fitness, missions, outcomes)
    by_world: dict[str, list[Outcome]] = {}
    for mission in missions:
        by_world.setdefault(mission.world, []).append(outcomes[mission.key])
    values = [
        sum(scores) / len(scores),
        stdev(scores) if len(scores) > 1 else math.nan,
        len(scores),
    ]
    for in_world in by_world.values():
        values.append(fmean(outcome.completed for outcome in in_world))
        values.append(fmean(outcome.progress for outcome in in_world))
    return dict(zip(name_score_columns(list(by_world)), values, strict=True))
