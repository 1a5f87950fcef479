"""The protocols of failure models, and the faults that they draw."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

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
"""The part of a robot that is at fault, by the signal that it spoils."""


@dataclass(frozen=True)
class Fault:
    """A filter that acts on a signal of the mission, on each channel from its onset on.

    The fault's name selects the stream of its random draws; faults with equal names are numbered in
    order. A fault of sensors has an onset for each sensor, any other a single one.
    """

    filter: Filter
    onset: Array  # (n,) [s] after the trigger, infinity: never
    name: str = ""  # empty: the filter's name
    signal: str = READINGS  # the signal that it spoils
    trigger: Trigger = AT_START
    part: str = ""  # as the column ``failed_parts`` names it; empty: by the signal
    values: tuple[int, ...] = ()  # places of the signal's values that it spoils; empty: all

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", self.filter.name)
        if not self.part:
            object.__setattr__(self, "part", PARTS.get(self.signal, ""))

    @property
    def effect(self) -> str:
        """The effect on a sensor, as the column ``failed_by`` names it."""
        return self.filter.name.lower()


def make_faults(case: Case, effect: Filter, sensors: int) -> tuple[Fault, ...]:
    """Return the fault of a case in a robot with so many sensors; none without a failure."""
    return (Fault(effect, case.onsets(sensors)),) if case.sensors else ()


@runtime_checkable
class Failure(Protocol):
    """Chooses which sensors fail and when."""

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """Return the faults of one mission; ``channels`` covers all sensors of the robot."""
        ...


@runtime_checkable
class PartialFailure(Failure, Protocol):
    """A failure model that may spoil other signals than the readings of sensors."""

    @property
    def parts(self) -> Sequence[str]:
        """The parts of the robot that can fail besides its sensors, as its faults name them."""
        ...


def list_parts(failure: Failure) -> tuple[str, ...]:
    """List the parts of a robot besides its sensors that a failure model can let fail."""
    return tuple(failure.parts) if isinstance(failure, PartialFailure) else ()


@runtime_checkable
class StatedFailure(Failure, Protocol):
    """A failure model whose effect on the readings stated cases have, too."""

    @property
    def effect(self) -> Filter:
        """The filter that acts from a failure on."""
        ...


@runtime_checkable
class SystematicFailure(Failure, Protocol):
    """A failure model whose faults follow from the number of the trial."""

    def count_cases(self, sensors: int) -> int:
        """Return after how many trials a robot with so many sensors meets the same faults again."""
        ...

    def draw_case(self, channels: Channels, trial: int) -> tuple[Fault, ...]:
        """Return the faults of all missions of a trial, counted from 0."""
        ...


class Adversary(Protocol):
    """The cases of one run, which change from generation to generation."""

    def list_cases(self) -> Sequence[Case]:
        """Return the case of each trial of the next generation, once for each."""
        ...

    def tell(self, scores: Mapping[int, Sequence[float]]) -> None:
        """Take the scores of that generation's trials, by the design, in the order of the trials.

        A design may have fewer trials than there are cases, or none.
        """
        ...


@runtime_checkable
class AdaptiveFailure(StatedFailure, Protocol):
    """A failure model whose cases in the selection follow from the scores of designs.

    In all other missions, ``draw`` draws the failures.
    """

    def start(self, sensors: int, trials: int, rng: Generator) -> Adversary:
        """Start a run of robots with so many sensors, and so many trials in a generation."""
        ...
