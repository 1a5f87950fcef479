"""The base class of filters, their channels and shared checks."""

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
"""The signals of a mission, in the order in which they are computed.

The signals are the sensor readings, the localized pose, the controller's command, the command as
the actuators carry it out, and the wheel strengths.
"""


@dataclass(frozen=True)
class Channels:
    """The n values that a filter changes, with their limits and meaning."""

    low: Array  # (n,) minimum value, -inf if there is none
    high: Array  # (n,) maximum value, reported by a range sensor that sees nothing
    position: Array  # (n, 3) [m], in the robot frame; zeros for a pose
    period: float  # time between two samples [s]
    names: tuple[str, ...] = ()  # (n,) quantities; empty for a pose
    signal: str = READINGS  # one of SIGNALS
    stops: Array | None = None  # (n,) the robot's maximum magnitudes; None: not a command

    @property
    def size(self) -> int:
        """The number of values."""
        return len(self.low)

    def samples(self, duration_s: float) -> int:
        """Return the number of samples in a duration, rounded up."""
        # The tolerance absorbs rounding: 0.3 / 0.1 is slightly above 3.
        return math.ceil(duration_s / self.period - 1e-6)


def select_channels(channels: Channels, onset: Array, of: str | None, part: str) -> Array:
    """Return ``onset`` (n,), with infinity for channels whose name does not begin with ``of``."""
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
    """Require that the channels are a pose; ``instead`` is the fix in the message."""
    if channels.signal != POSE:
        raise InputError(
            f"{part}: must filter a pose (x, y, yaw, speed), not {_describe(channels)}; {instead}"
        )


def refuse_pose(channels: Channels, part: str) -> None:
    """Require that the channels are not a pose, whose values have different units."""
    if channels.signal == POSE:
        raise InputError(
            f"{part}: must filter readings or a command, not a pose (x, y, yaw, speed); for a "
            f"pose, use stuck, silence, pose_jump or pose_drift"
        )


def _describe(channels: Channels) -> str:
    names = {READINGS: f"{channels.size} readings", STRENGTH: "wheel strengths (left, right)"}
    return names.get(channels.signal, "a command (speed, steering)")


class Held(NamedTuple):
    """The memory of a filter that repeats values: (n,) counters and values."""

    counter: Array
    value: Array


def hold_nothing(channels: Channels) -> Held:
    """Return a memory that holds no value yet."""
    return Held(np.zeros(channels.size), np.full(channels.size, math.nan))


FILTER_ARGUMENTS = "parameters", "memory", "rng", UNUSED, "values", "time"
"""Arguments of a filter's rule, which changes ``values`` in place; NaN means no value."""

ENDS, ALTERS, GROWS = EFFECTS = "ends", "alters", "grows"
"""Effects on readings: independent of the surroundings, altered, or increasingly independent."""

FILTER_RULES = {"effect": one_of(*EFFECTS), "name": TEXT}


@compilable
def add_within(value: float, amount: float, low: float, high: float) -> float:
    """Return the sum of a reading and an error, clipped to the limits of its channel.

    A value at ``high`` is unchanged because it means that a range sensor sees nothing.
    """
    return min(max(value + amount, low), high) if value < high else value


class Filter(ABC):
    """Noise, a delay or a fault between a source (sensors, localization) and the controller."""

    name: str
    """The filter's name in the random streams of faults and in the column ``failed_by``.

    Results depend on the name, so it must not change if the class is renamed.
    """
    effect: str = ALTERS  # effect on readings, for figures: ``ENDS``, ``ALTERS`` or ``GROWS``
    rule: Callable[..., None]
    """The function that changes each sample; a static method, so that numba can compile it.

    The function's arguments are a subset of ``FILTER_ARGUMENTS``.
    """

    @abstractmethod
    def start(self, channels: Channels, onset: Array, rng: Generator) -> Started:
        """Return the parameters and the memory of ``rule`` for one mission.

        ``onset`` (n,) is the time [s] at which the filter starts to act on each channel: 0 for an
        ordinary filter, infinity for a channel that it never changes.
        """


A_FILTER = instance_of(Filter, "a filter (a subclass of evoros.parts.Filter)")
FILTERS = mapping_of(Filter, "filters (subclasses of evoros.parts.Filter)")
