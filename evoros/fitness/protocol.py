"""What a fitness must offer."""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from evoros.mission.outcome import Outcome


@runtime_checkable
class Fitness(Protocol):
    """Scores a design; more is better."""

    def score(self, outcomes: Sequence[Outcome]) -> float:
        """The fitness of one trial: ``outcomes`` has one mission in each world, and all were flown.

        The fitness of a design is the mean over its trials. ``least_clearance_m`` is NaN in a
        world without obstacles, and ``first_collision_s`` without a collision.
        """
        ...

    def worst(self, outcomes: Sequence[Outcome]) -> float:
        """The fitness of a trial of which at least one mission could not be flown.

        At most what ``score`` gives for nothing done in any world. What such a mission did not
        measure is NaN; ``sensors`` and ``time_limit_s`` are as in any other.
        """
        ...
