"""The protocol of onsets."""

from typing import Protocol, runtime_checkable

from numpy.random import Generator

from evoros.base.checks import instance_of
from evoros.failure.trigger import Trigger


@runtime_checkable
class Onset(Protocol):
    """Chooses when a part fails."""

    def draw(self, rng: Generator) -> tuple[Trigger, float]:
        """Return an event of the mission, and the time [s] from it to the failure.

        It draws as many numbers in every mission.
        """
        ...


AN_ONSET = instance_of(Onset, "an onset (draw)")
