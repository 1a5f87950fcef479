"""The base class of onsets."""

from abc import ABC, abstractmethod

from numpy.random import Generator

from evoros.base.checks import instance_of
from evoros.failure.protocol import Trigger


class Onset(ABC):
    """Chooses when a part fails."""

    @abstractmethod
    def draw(self, rng: Generator) -> tuple[Trigger, float]:
        """Return an event and a delay [s]; every mission must draw equally many random numbers."""


AN_ONSET = instance_of(Onset, "an onset (a subclass of evoros.parts.Onset)")
