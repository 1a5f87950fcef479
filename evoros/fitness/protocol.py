"""The protocols of fitness functions."""

from collections.abc import Mapping, Sequence
from typing import Protocol, runtime_checkable

from evoros.mission.outcome import Outcome
from evoros.world.model import World


@runtime_checkable
class Fitness(Protocol):
    """Scores a design; more is better.

    It may have a ``title`` for figures, and a ``unit``. Without a title, figures show the name of
    its class. If it has ``bounds(worlds)``, the minimum and maximum of a score over so many worlds,
    no interval is shown beyond them.
    """

    def score(self, outcomes: Sequence[Outcome]) -> float:
        """Return the score of a trial, whose outcomes come from one mission in each world.

        The fitness of a design is the mean over its trials, unless this is a ``CombiningFitness``.
        ``least_clearance_m`` is NaN in a world without obstacles, and ``first_collision_s`` without
        a collision.
        """

    def worst(self, outcomes: Sequence[Outcome]) -> float:
        """Return the score of a trial in which at least one mission could not be run.

        It is at most the ``score`` of a trial without any progress. Metrics of such a mission are
        NaN, but ``sensors`` and ``time_limit_s`` are valid.
        """


@runtime_checkable
class SelectiveFitness(Fitness, Protocol):
    """A fitness that needs something of the worlds."""

    def check_worlds(self, worlds: Mapping[str, World]) -> None:
        """Refuse worlds that lack it, before a run.

        Raises:
            InputError: a world lacks it.
        """


@runtime_checkable
class CombiningFitness(Fitness, Protocol):
    """A fitness of a design that is not the mean over its trials."""

    def combine(self, scores: Sequence[float]) -> float:
        """Return the fitness of a design from the scores of its trials, at least one."""
