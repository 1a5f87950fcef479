"""The base classes of failure models, with faults, cases and triggers."""

import math
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import ask, sequence_of
from evoros.base.errors import InputError
from evoros.filter.protocol import READINGS, SIGNALS, Channels, Filter

INTACT = "intact"  # text of the case without failing sensors
MODEL, NOMINAL, SCREENED, CONFIRMED = "model", "nominal", "screened", "confirmed"
"""Purposes of trials: estimate the risk, test the intact design, find bad cases, confirm them."""


@dataclass(frozen=True)
class Case:
    """The indices of failing sensors, ascending, and the time [s] of each failure."""

    sensors: tuple[int, ...] = ()
    times_s: tuple[float, ...] = ()

    @classmethod
    def of(cls, failures: Iterable[tuple[int, float]]) -> "Case":
        """Return the case with these (sensor, time) pairs, given in any order."""
        ordered = sorted(failures)
        return cls(tuple(n for n, _ in ordered), tuple(float(time) for _, time in ordered))

    @classmethod
    def parse(cls, text: str) -> "Case":
        """Read a case from its ``text``; raise a ValueError for any other text."""
        parts = [] if text == INTACT else [part.split("@") for part in text.split(" ")]
        return cls.of((int(sensor), float(time)) for sensor, time in parts)

    @property
    def text(self) -> str:
        """The case as a table cell, such as ``0@40.0 3@52.5`` with times in s."""
        pairs = zip(self.sensors, self.times_s, strict=True)
        return " ".join(f"{sensor}@{time!r}" for sensor, time in pairs) or INTACT

    def onsets(self, count: int) -> Array:
        """Return the failure times (count,) [s] of sensors; infinity for never."""
        onset = np.full(count, math.inf)
        for sensor, time in zip(self.sensors, self.times_s, strict=True):
            if sensor < count:
                onset[sensor] = time
        return onset


START, PLACE, COURSE, DISTANCE, WAYPOINT, USE = TRIGGERS = range(6)  # events; see ``Trigger``


@dataclass(frozen=True)
class Trigger:
    """A mission event, by default the start; only its first occurrence counts."""

    kind: int = START
    values: tuple[float, ...] = ()  # arguments of the constructors below
    since_s: float = 0.0  # mission time at which the trigger was added

    @classmethod
    def at_place(cls, x_m: float, y_m: float, radius_m: float) -> Self:
        """Return an event that occurs when the robot's origin is within ``radius_m`` of a place."""
        return cls(PLACE, (x_m, y_m, radius_m))

    @classmethod
    def on_course(cls, share: float) -> Self:
        """Return an event that occurs after this fraction (0 to 1) of the robot's route."""
        return cls(COURSE, (share,))

    @classmethod
    def after_distance(cls, distance_m: float) -> Self:
        """Return an event that occurs when the robot has covered this length of its route."""
        return cls(DISTANCE, (distance_m,))

    @classmethod
    def at_waypoint(cls, number: int) -> Self:
        """Return an event that occurs at waypoint ``number``, counted from 1; home is the last."""
        return cls(WAYPOINT, (float(number),))

    @classmethod
    def by_use(cls, amount: float, per_s: float, per_m: float) -> Self:
        """Return an event that occurs when ``amount`` is used up, at rates per second and metre."""
        return cls(USE, (amount, per_s, per_m))


AT_START = Trigger()


def is_timed(trigger: Trigger) -> bool:
    """Return True if onsets after the trigger are mission times."""
    return trigger.kind == START


NEVER = math.inf  # onset [s] of a fault that never occurs
_PARTS = "sensors", "localization", "commands", "drive", "wheels"
PARTS: Mapping[str, str] = dict(zip(SIGNALS, _PARTS, strict=True))  # parts named by signal


@dataclass(frozen=True)
class Fault:
    """A filter that acts on a signal of a mission from its onset on.

    The name and number of a fault select a random stream. A fault of sensors has one onset per
    sensor, any other fault a single onset.
    """

    filter: Filter
    onset: Array  # (n,) [s] after the trigger; infinity for never
    name: str = ""  # the filter's name if empty
    signal: str = READINGS  # affected signal
    trigger: Trigger = AT_START
    part: str = ""  # name in the column failed_parts; follows from the signal if empty
    values: tuple[int, ...] = ()  # indices of affected values; all if empty
    number: int = 0  # index among faults of equal signal and name, set by the mission

    def __post_init__(self) -> None:
        if not self.name:
            object.__setattr__(self, "name", self.filter.name)
        if not self.part:
            object.__setattr__(self, "part", PARTS.get(self.signal, ""))

    @property
    def effect(self) -> str:
        """The effect, named as in the column ``failed_by``."""
        return self.filter.name.lower()


class Failure(ABC):
    """A failure model, which draws the faults of each mission."""

    effect: Filter | None = None  # filter that failures apply, including failures in stated cases

    @property
    def parts(self) -> Sequence[str]:
        """The parts other than sensors that can fail, named as in faults."""
        return ()

    @abstractmethod
    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        """Return the faults of a mission; ``channels`` has one value per sensor."""


_FAULTS = sequence_of(Fault, "faults")


def draw_faults(
    failure: Failure, channels: Channels, rng: Generator, earlier: Sequence[Fault] = ()
) -> tuple[Fault, ...]:
    """Draw and check a mission's faults; numbers continue from the robot's ``earlier`` faults."""
    faults: tuple[Fault, ...] = ask("failure", failure.draw, _FAULTS, channels, rng)
    for fault in faults:
        _check_fault(fault, failure, channels.size)
    return number_faults(faults, earlier)


def make_faults(failure: Failure, case: Case, sensors: int) -> tuple[Fault, ...]:
    """Return the fault of a case for a number of ``sensors``; none if no sensor fails."""
    if failure.effect is None:
        raise InputError(
            f"failure: a failure model with cases must set effect; add effect to {failure!r}"
        )
    return (Fault(failure.effect, case.onsets(sensors)),) if case.sensors else ()


def number_faults(faults: Sequence[Fault], earlier: Sequence[Fault] = ()) -> tuple[Fault, ...]:
    """Number faults of equal signal and name, continuing from the robot's ``earlier`` faults."""
    counts = Counter((fault.signal, fault.name) for fault in earlier)
    numbered = []
    for fault in faults:
        kind = fault.signal, fault.name
        numbered.append(replace(fault, number=counts[kind]))
        counts[kind] += 1
    return tuple(numbered)


def _check_fault(fault: Fault, failure: Failure, sensors: int) -> None:
    name = type(failure).__name__
    if fault.signal not in SIGNALS:
        raise InputError(
            f"failure: {name} drew a fault of the unknown signal {fault.signal!r}; draw faults "
            f"of {', '.join(SIGNALS)} only"
        )
    onset, count = np.asarray(fault.onset), sensors if fault.signal == READINGS else 1
    if onset.shape != (count,) or onset.dtype.kind != "f" or np.isnan(onset).any():
        each = f"each of the {count} sensors" if fault.signal == READINGS else f"the {fault.part}"
        raise InputError(
            f"failure: {name} must draw one onset time [s] for {each} (infinity: never), not "
            f"{fault.onset!r}; correct its draw method"
        )
    if fault.signal != READINGS and fault.part not in failure.parts:
        raise InputError(
            f"failure: the parts of {name}, {list(failure.parts)}, must include {fault.part}, "
            f"which one of the faults affects; add that part to the class"
        )


class SystematicFailure(Failure):
    """A failure model with a finite number of cases, which trials use in random order."""

    effect: Filter

    @abstractmethod
    def count_cases(self, sensors: int) -> int:
        """Return the number of cases, at least 1, for a number of ``sensors``."""

    @abstractmethod
    def state_case(self, sensors: int, number: int) -> Case:
        """Return case ``number``, counted from 0, for a number of ``sensors``."""


class Adversary(Protocol):
    """The evolving cases of a run."""

    def list_cases(self) -> Sequence[Case]:
        """Return the cases of the next generation, one per trial; called once per generation.

        Trials use the cases in random order unless every design is tested in all cases.
        """

    def tell(self, scores: Mapping[int, Mapping[int, float]]) -> None:
        """Receive scores by design and case index; a design may lack some cases, or all."""


class AdaptiveFailure(Failure):
    """A failure model with cases that depend, during selection, on the scores of designs."""

    @abstractmethod
    def start(self, sensors: int, trials: int, rng: Generator) -> Adversary:
        """Return the initial cases of a run with ``trials`` trials per generation."""
