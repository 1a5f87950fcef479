"""The base classes of fitness functions."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from evoros.mission.mission import Outcome
from evoros.world.model import World


class Fitness(ABC):
    """Scores a design; higher is better."""

    @property
    def title(self) -> str:
        """The name in figures; if empty, figures show the class name."""
        return ""

    @property
    def unit(self) -> str:
        """The unit of the score; empty if dimensionless."""
        return ""

    def bounds(self, worlds: int) -> tuple[float, ...]:
        """Return the minimum and maximum of a score over ``worlds``; empty if unknown.

        Intervals never extend beyond these bounds.
        """
        return ()

    def check_worlds(self, worlds: Mapping[str, World]) -> None:  # noqa: B027 - accepts any worlds
        """Raise an InputError, before a run, if a world lacks something that the fitness needs."""

    @abstractmethod
    def score(self, outcomes: Sequence[Outcome]) -> float:
        """Return the score of a trial from the outcomes of one mission in each world.

        The fitness of a design is the mean over its trials, except for a ``CombiningFitness``.
        ``least_clearance_m`` is NaN in a world without obstacles, and ``first_collision_s`` is NaN
        without a collision.
        """

    @abstractmethod
    def worst(self, outcomes: Sequence[Outcome]) -> float:
        """Return the score of a trial in which at least one mission could not be run.

        Certificates rely on this score being at most the ``score`` of any trial. The metrics of a
        mission that was not run are NaN, but ``sensors`` and ``time_limit_s`` are valid.
        """


class AdditiveFitness(Fitness):
    """A fitness function that scores each mission, so that missions are samples of intervals."""

    @abstractmethod
    def score_missions(self, outcomes: Sequence[Outcome]) -> Sequence[float]:
        """Return a score for each mission, bounded like ``score``, which is their mean."""


class CombiningFitness(Fitness):
    """A fitness function for which a design's fitness is not the mean over its trials."""

    @abstractmethod
    def combine(self, scores: Sequence[float], trials: int | None = None) -> float:
        """Return the fitness of a design from the scores of at least one trial.

        With ``trials``, return the fitness expected from that number of these trials (or from all,
        if there are fewer), so that designs with different numbers of trials can be compared.
        """

    def bound_combined(
        self, scores: Sequence[float], limits: tuple[float, float], confidence: float
    ) -> tuple[float, float]:
        """Return the interval of the fitness, NaN if unknown; all scores are within ``limits``."""
        return math.nan, math.nan
