"""The outcomes of a design -> its row in a table of evaluated designs."""

from collections.abc import Mapping, Sequence
from statistics import fmean, stdev

from evoros.evaluation import trial_scores
from evoros.fitness import Fitness
from evoros.mission import Mission, Place
from evoros.outcome import Outcome


def score_columns(worlds: Sequence[str]) -> list[str]:
    """The names of what ``scores`` gives."""
    each = [f"{world}_{what}" for world in worlds for what in ("completed", "progress")]
    return ["fitness_mean", "fitness_sd", "trials", *each]


def scores(
    fitness: Fitness, missions: Sequence[Mission], outcomes: Mapping[Place, Outcome]
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
        there.setdefault(mission.world, []).append(outcomes[mission.place])
    values = [
        sum(trials) / len(trials),  # as fitness_of
        stdev(trials) if len(trials) > 1 else float("nan"),
        len(trials),
    ]
    for flown in there.values():
        values.append(fmean(outcome.completed for outcome in flown))
        values.append(fmean(outcome.progress for outcome in flown))
    return dict(zip(score_columns(list(there)), values, strict=True))
