"""Scores the outcomes of one design."""

import math
from collections.abc import Mapping, Sequence
from statistics import fmean, stdev

from evoros.base.errors import InputError
from evoros.fitness.protocol import Fitness
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import NOT_RUN, Outcome


def fitness_of(
    fitness: Fitness, missions: Sequence[Mission], outcomes: Mapping[MissionKey, Outcome]
) -> float:
    """Mean over the trials of the score over the worlds.

    Raises:
        InputError: a score is not a finite number.
    """
    scores = trial_scores(fitness, missions, outcomes)
    return sum(scores) / len(scores)


def trial_scores(
    fitness: Fitness, missions: Sequence[Mission], outcomes: Mapping[MissionKey, Outcome]
) -> list[float]:
    """The score of each trial over the worlds, in the order of the missions.

    A trial of which a mission could not be flown counts as the worst, whatever the others did.

    Raises:
        InputError: a score is not a finite number.
    """
    by_trial: dict[int, list[Outcome]] = {}
    for mission in missions:
        by_trial.setdefault(mission.trial, []).append(outcomes[mission.key])
    scores = [float(_score(fitness, trial)) for trial in by_trial.values()]
    if not all(map(math.isfinite, scores)):
        raise InputError(
            f"fitness: must score every trial with a finite number, not {scores}; correct "
            f"{type(fitness).__name__}"
        )
    return scores


def _score(fitness: Fitness, trial: Sequence[Outcome]) -> float:
    flown = all(outcome.ended not in NOT_RUN for outcome in trial)
    return fitness.score(trial) if flown else fitness.worst(trial)


def score_columns(worlds: Sequence[str]) -> list[str]:
    """The names of what ``scores`` gives."""
    each = [f"{world}_{what}" for world in worlds for what in ("completed", "progress")]
    return ["fitness_mean", "fitness_sd", "trials", *each]


def scores(
    fitness: Fitness, missions: Sequence[Mission], outcomes: Mapping[MissionKey, Outcome]
) -> dict[str, float]:
    """Of the missions of one design: the mean and the standard deviation (n - 1; NaN for one) of
    the fitness over its trials, their number, and for each world the share completed and the mean
    progress.

    Raises:
        InputError: a score is not a finite number.
    """
    trials = trial_scores(fitness, missions, outcomes)
    there: dict[str, list[Outcome]] = {}
    for mission in missions:
        there.setdefault(mission.world, []).append(outcomes[mission.key])
    values = [
        sum(trials) / len(trials),  # as fitness_of
        stdev(trials) if len(trials) > 1 else float("nan"),
        len(trials),
    ]
    for flown in there.values():
        values.append(fmean(outcome.completed for outcome in flown))
        values.append(fmean(outcome.progress for outcome in flown))
    return dict(zip(score_columns(list(there)), values, strict=True))
