"""The base classes of fitness functions."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence

from evoros.mission.mission import Outcome
from evoros.world.model import World


class Fitness(ABC):
    """A score of designs; higher is better."""

    @property
    def title(self) -> str:
        """The name in figures; empty for the class name."""
        return ""

    @property
    def unit(self) -> str:
        """The unit of the score; empty if dimensionless."""
        return ""

    def bounds(self, worlds: int) -> tuple[float, ...]:
        """Return the range of scores for ``worlds``, which intervals use too; empty if unknown."""
        return ()

    def check_worlds(self, worlds: Mapping[str, World]) -> None:  # noqa: B027 - accepts any worlds
        """Raise an InputError, before a run, if a world lacks something that the score needs."""

    @abstractmethod
    def score(self, outcomes: Sequence[Outcome]) -> float:
        """Return the score of a trial from the outcomes of one mission per world.

        The fitness of a design is the mean over its trials, except for a ``CombiningFitness``.
        ``least_clearance_m`` is NaN in worlds without obstacles, ``first_collision_s`` without
        collisions.
        """

    @abstractmethod
    def worst(self, outcomes: Sequence[Outcome]) -> float:
        """Return the score of a trial with at least one mission that could not run.

        It must not exceed the ``score`` of any trial, because certificates rely on that. The
        metrics of missions that did not run are NaN, but ``sensors`` and ``time_limit_s`` are
        valid.
        """


class AdditiveFitness(Fitness):
    """A fitness function that scores missions, so that each mission is a sample for intervals."""

    @abstractmethod
    def score_missions(self, outcomes: Sequence[Outcome]) -> Sequence[float]:
        """Return the score of each mission; ``score`` is their mean and has the same bounds."""


class CombiningFitness(Fitness):
    """A fitness function that does not average the scores of trials."""

    @abstractmethod
    def combine(self, scores: Sequence[float], trials: int | None = None) -> float:
        """Return the fitness of a design from the scores of one or more trials.

        With ``trials``, return the fitness expected from that number of trials (at most the number
        of scores), to compare designs with different numbers of trials.
        """

    def bound_combined(
        self, scores: Sequence[float], limits: tuple[float, float], confidence: float
    ) -> tuple[float, float]:
        """Return the fitness's interval, NaN if unknown; the scores are within ``limits``."""
        return math.nan, math.nan
