"""The base class of filters, the channels that they change, and common checks."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import TEXT, instance_of, mapping_of, one_of
from evoros.base.compilable import compilable
from evoros.base.errors import InputError
from evoros.compilation.named_rules import UNUSED, Started

SIGNALS = "readings", "pose", "command", "drive", "strength"
READINGS, POSE, COMMAND, DRIVE, STRENGTH = SIGNALS
"""Sensor readings, localized pose, command, command to actuators, and wheel strengths, in order."""


@dataclass(frozen=True)
class Channels:
    """The n values that a filter changes, their limits and their meaning."""

    low: Array  # (n,) minimum values, -inf if unlimited
    high: Array  # (n,) maximum values; a range sensor that sees nothing reports this value
    position: Array  # (n, 3) [m], sensor positions in the robot frame; zeros for a pose
    period: float  # [s], time between consecutive samples
    names: tuple[str, ...] = ()  # (n,) names of the quantities; empty for a pose
    signal: str = READINGS  # one of SIGNALS
    stops: Array | None = None  # (n,) the robot's maximum commands; None: no commands

    @property
    def size(self) -> int:
        """The number of values n."""
        return len(self.low)

    def samples(self, duration_s: float) -> int:
        """Return the number of samples in a duration [s], rounded up."""
        # The tolerance absorbs rounding errors, as in 0.3 / 0.1 > 3.
        return math.ceil(duration_s / self.period - 1e-6)


def select_channels(channels: Channels, onset: Array, of: str | None, part: str) -> Array:
    """Return ``onset`` (n,), set to infinity for channels whose name lacks the prefix ``of``."""
    if of is None:
        return onset
    chosen = [name.startswith(of) for name in channels.names]
    if not any(chosen):
        known = ", ".join(dict.fromkeys(channels.names)) or "none"
        raise InputError(
            f"{part}.of: must be a prefix of a channel name ({known}), not {of!r}; choose one of "
            "these, or set it to null for all channels"
        )
    return np.where(chosen, onset, math.inf)


def require_pose(channels: Channels, part: str, instead: str) -> None:
    """Require that the channels are a pose; ``instead`` is the advice in the message."""
    if channels.signal != POSE:
        raise InputError(
            f"{part}: must filter a pose (x, y, yaw, speed), not {_describe(channels)}; {instead}"
        )


def refuse_pose(channels: Channels, part: str) -> None:
    """Require that the channels are not a pose, because its values differ in their units."""
    if channels.signal == POSE:
        raise InputError(
            f"{part}: must filter readings or a command, not a pose (x, y, yaw, speed); for a "
            f"pose, use stuck, silence, pose_jump or pose_drift"
        )


def _describe(channels: Channels) -> str:
    names = {READINGS: f"{channels.size} readings", STRENGTH: "wheel strengths (left, right)"}
    return names.get(channels.signal, "a command (speed, steering)")


class Held(NamedTuple):
    """The memory (counters and values, both (n,)) of a filter that repeats values."""

    counter: Array
    value: Array


def hold_nothing(channels: Channels) -> Held:
    """Return the memory of a filter that has not yet held a value."""
    return Held(np.zeros(channels.size), np.full(channels.size, math.nan))


FILTER_ARGUMENTS = "parameters", "memory", "rng", UNUSED, "values", "time"
"""The arguments of a filter's rule, which modifies ``values`` in place; NaN means no value."""

ENDS, ALTERS, GROWS = EFFECTS = "ends", "alters", "grows"
"""Effects on readings: independent of the surroundings, altered, or increasingly independent."""

FILTER_RULES = {"effect": one_of(*EFFECTS), "name": TEXT}


@compilable
def add_within(value: float, amount: float, low: float, high: float) -> float:
    """Add an error to a reading and clip it to the limits; ``high`` (nothing seen) stays."""
    return min(max(value + amount, low), high) if value < high else value


class Filter(ABC):
    """Noise, delay or fault of a signal between its source and its reader."""

    name: str  # name in ``failed_by`` and random streams, so fixed even if the class is renamed
    effect: str = ALTERS  # effect on readings, shown in figures: ``ENDS``, ``ALTERS`` or ``GROWS``
    rule: Callable[..., None]  # static; takes some of ``FILTER_ARGUMENTS`` to change samples

    @abstractmethod
    def start(self, channels: Channels, onset: Array, rng: Generator) -> Started:
        """Return the parameters and the memory of ``rule`` for a mission.

        ``onset`` (n,) is the time [s] at which each channel's filter becomes active: 0 for ordinary
        filters, infinity for channels that stay unchanged.
        """


A_FILTER = instance_of(Filter, "a filter (a subclass of evoros.parts.Filter)")
FILTERS = mapping_of(Filter, "filters (subclasses of evoros.parts.Filter)")
