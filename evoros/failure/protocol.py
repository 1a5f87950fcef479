"""The base classes of failure models, and their faults."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.failure.case import Case
from evoros.failure.trigger import AT_START, Trigger
from evoros.filter.protocol import COMMAND, DRIVE, POSE, READINGS, STRENGTH, Channels, Filter

PARTS: Mapping[str, str] = {
    READINGS: "sensors",
    POSE: "localization",
    COMMAND: "commands",
    DRIVE: "drive",
    STRENGTH: "wheels",
}
"""The failed part of a robot by affected signal."""


@dataclass(frozen=True)
class Fault:
    """A filter on a signal of the mission that starts at an onset.

    Its name and number select its random stream. A sensor fault has one onset per sensor; any other
    fault has one.
    """

    filter: Filter
    onset: Array  # (n,) [s] after the trigger; infinity: never
    name: str = ""  # empty: the filter's name
    signal: str = READINGS  # affected signal
    trigger: Trigger = AT_START
    part: str = ""  # name in the column ``failed_parts``; empty: by the signal
    values: tuple[int, ...] = ()  # indices of the affected values; empty: all
    number: int = 0  # index among faults of the same signal and name, set by the mission

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", self.filter.name)
        if not self.part:
            object.__setattr__(self, "part", PARTS.get(self.signal, ""))

    @property
    def effect(self) -> str:
        """The effect as named in the column ``failed_by``."""
        return self.filter.name.lower()


def make_faults(case: Case, effect: Filter, sensors: int) -> tuple[Fault, ...]:
    """Return the fault of a case in a robot with ``sensors`` sensors; none if all are intact."""
    return (Fault(effect, case.onsets(sensors)),) if case.sensors else ()


class Failure(ABC):
    """A failure model: draws the faults of each mission."""

    effect: Filter | None = None
    """The filter that a failure applies; stated sensor cases use it, too."""

    @property
    def parts(self) -> Sequence[str]:
        """The parts that can fail in addition to sensors, as its faults name them."""
        return ()

    @abstractmethod
    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """Return the faults of one mission; ``channels`` has one value per sensor of the robot."""


class SystematicFailure(Failure):
    """A failure model with countable cases and an ``effect``.

    The trials of a design run through the cases in a random order; ``draw`` picks one uniformly.
    """

    effect: Filter

    @abstractmethod
    def count_cases(self, sensors: int) -> int:
        """Return the number of cases of a robot with ``sensors`` sensors, at least 1."""

    @abstractmethod
    def state_case(self, sensors: int, number: int) -> Case:
        """Return case ``number``, from 0, of a robot with ``sensors`` sensors."""


class Adversary(Protocol):
    """The evolving cases of one run."""

    def list_cases(self) -> Sequence[Case]:
        """Return the cases of the next generation, one per trial; called once per generation.

        Trials use them in a random order unless every design meets all of them.
        """

    def tell(self, scores: Mapping[int, Mapping[int, float]]) -> None:
        """Take the scores of that generation by design, then by place of the case.

        A design may have met only some of the cases, or none.
        """


class AdaptiveFailure(Failure):
    """A failure model whose cases in the selection depend on the scores of designs.

    All other missions use ``draw``.
    """

    @abstractmethod
    def start(self, sensors: int, trials: int, rng: Generator) -> Adversary:
        """Start a run; ``trials`` is the number per generation."""
