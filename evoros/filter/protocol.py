"""The protocol of filters, and what several of them share."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.checks import instance_of, mapping_of
from evoros.base.compilable import compilable
from evoros.base.errors import InputError
from evoros.compilation.named_rules import UNUSED, Started

SIGNALS = "readings", "pose", "command", "drive", "strength"
READINGS, POSE, COMMAND, DRIVE, STRENGTH = SIGNALS
"""The signals of a mission, in their order: readings of sensors; the pose as localized; the command
of the controller on its way; what the actuators make of it; the strength of the wheels."""


@dataclass(frozen=True)
class Channels:
    """The properties of the n values that a filter changes."""

    low: Array  # (n,) minimum value, -inf if there is none
    high: Array  # (n,) maximum value; a range sensor that sees nothing reports it
    position: Array  # (n, 3) place on the robot [m], zeros for a pose
    period: float  # time between two samples [s]
    names: tuple[str, ...] = ()  # (n,) of the quantities; none for a pose
    signal: str = READINGS  # one of SIGNALS
    stops: Array | None = None  # (n,) greatest size that a robot can do; None: not of a command

    @property
    def size(self) -> int:
        """The number of values."""
        return len(self.low)

    def samples(self, duration_s: float) -> int:
        """Return how many samples a duration takes, rounded up."""
        # In floating point 0.3 / 0.1 is slightly above 3; the tolerance ignores such an excess.
        return math.ceil(duration_s / self.period - 1e-6)


def select_channels(channels: Channels, onset: Array, of: str | None, part: str) -> Array:
    """Return ``onset`` (n,), but infinity for channels whose name does not begin with ``of``.

    Raises:
        InputError: there is no such channel; ``part`` is the filter, for the message.
    """
    if of is None:
        return onset
    chosen = [name.startswith(of) for name in channels.names]
    if not any(chosen):
        known = ", ".join(dict.fromkeys(channels.names)) or "which have no names here"
        raise InputError(
            f"{part}.of: must begin the name of a channel ({known}), not {of!r}; name one of them, "
            f"or set it to null for all"
        )
    return np.where(chosen, onset, math.inf)


def require_pose(channels: Channels, part: str, instead: str) -> None:
    """Require that a filter changes a pose; ``instead`` is the fix.

    Raises:
        InputError: the channels are another signal.
    """
    if channels.signal != POSE:
        raise InputError(
            f"{part}: must filter a pose (x, y, yaw, speed), not {_describe(channels)}; {instead}"
        )


def refuse_pose(channels: Channels, part: str) -> None:
    """Require that a filter does not change a pose, whose values have nothing in common.

    Raises:
        InputError: the channels are a pose.
    """
    if channels.signal == POSE:
        raise InputError(
            f"{part}: must filter readings or a command, not a pose (x, y, yaw, speed); use "
            f"stuck, silence, pose_jump or pose_drift here"
        )


def _describe(channels: Channels) -> str:
    if channels.signal == READINGS:
        return f"{channels.size} readings"
    if channels.signal == STRENGTH:
        return "the strength of wheels (left, right)"
    return "a command (speed, steering)"


class Held(NamedTuple):
    """The memory of a filter that repeats values: a counter and a value for each channel."""

    counter: Array
    value: Array


def hold_nothing(channels: Channels) -> Held:
    """Return the memory of a filter that has not held a value yet."""
    return Held(np.zeros(channels.size), np.full(channels.size, math.nan))


FILTER_ARGUMENTS = "parameters", "memory", "rng", UNUSED, "values", "time"
"""The rule of a filter changes ``values`` (n,) in place at ``time`` [s]; NaN is silence."""

ENDS, ALTERS, GROWS = EFFECTS = "ends", "alters", "grows"
"""Readings no longer depend on the surroundings; they do, but not as before; less and less."""


@compilable
def add_within(value: float, amount: float, low: float, high: float) -> float:
    """Return the sum of a reading and an error, clipped to the limits of its channel.

    A range sensor that sees nothing reports its limit exactly, so a value that is not below
    ``high`` stays as it is.
    """
    return min(max(value + amount, low), high) if value < high else value


@runtime_checkable
class Filter(Protocol):
    """Noise, a delay or a fault between a source (sensors, localization) and the controller."""

    @property
    def name(self) -> str:
        """Names the filter in the random streams of faults and in the column ``failed_by``.

        Runs depend on it, so it stays the same if the class is renamed.
        """
        ...

    @property
    def effect(self) -> str:
        """The effect on readings, for figures: ``ENDS``, ``ALTERS`` or ``GROWS``."""
        ...

    @property
    def rule(self) -> Callable[..., None]:
        """Change each sample; a static method, so that numba can compile it.

        It takes the arguments that it uses, of those in ``FILTER_ARGUMENTS``.
        """
        ...

    def start(self, channels: Channels, onset: Array, rng: Generator) -> Started:
        """Return the parameters and the memory of ``rule`` for one mission.

        ``onset`` (n,) is the time [s] from which the filter acts on each channel: zeros for an
        ordinary filter, infinity for a channel that it does not act on.
        """
        ...


A_FILTER = instance_of(Filter, "a filter (name, effect, rule and start)")
FILTERS = mapping_of(Filter, "filters (name, effect, rule and start)")
