"""What faults do to readings, for figures: end them, alter them, or alter them more and more.

A failure model states only which filter acts from when on, and a filter may be anybody's. So each
filter is tried on two signals that differ after its onset, and what it makes of them is compared.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from evoros.base import rng as randomness
from evoros.base.arrays import Array
from evoros.failure.protocol import Failure, Fault, SystematicFailure
from evoros.filter.protocol import Channels, Filter

if TYPE_CHECKING:
    from numpy.random import Generator

    from evoros.robot.model import Robot

ENDS, ALTERS, GROWS = "ends", "alters", "grows"
"""Readings no longer depend on what is seen; they do, but not as before; they do less and less."""
_SAMPLES = 600  # after the onset
_EARLY = 30  # of these
_DRAWS, _MOST_CASES = 20, 50  # of faults, in which their filters are looked for
_MOST_CHANNELS = 4  # of a type of sensor, that are tried
_PERIOD_S = 0.1  # of the samples
_STEP = 0.2  # by which the second signal differs, as a share of the range


def describe_effects(failure: Failure, robot: "Robot", channels: Channels) -> dict[str, str]:
    """Return ``ENDS``, ``ALTERS`` or ``GROWS`` for each effect of a failure model, by its name.

    ``robot`` has the sensors of a design, and ``channels`` describes them to failures.
    """
    tried = _select_channels(robot)
    found = {each.name.lower(): each for each in _list_filters(failure, channels)}
    return {name: classify_effect(found[name], tried) for name in sorted(found)}


def _select_channels(robot: "Robot") -> Channels:
    """Describe the first channels of each type of sensor."""
    types = dict.fromkeys(mount.sensor for mount in robot.mounts)
    chosen = [each for name in types for each in robot.sensors[name].channels[:_MOST_CHANNELS]]
    return Channels(
        low=np.array([each.low for each in chosen], dtype=np.float64),
        high=np.array([each.high for each in chosen], dtype=np.float64),
        position=np.zeros((len(chosen), 3)),
        period=_PERIOD_S,
        names=tuple(each.name for each in chosen),
    )


def _list_filters(failure: Failure, channels: Channels) -> Iterator[Filter]:
    """Yield the filters that a failure model states, and those of some faults that it draws."""
    stated = getattr(failure, "effect", None)
    if isinstance(stated, Filter):
        yield stated
    parts = getattr(failure, "failures", {})
    if isinstance(parts, Mapping):
        for part in parts.values():
            yield from _list_filters(part, channels)
    yield from {fault.effect: fault.filter for fault in _draw(failure, channels)}.values()


def _draw(failure: Failure, channels: Channels) -> Iterable[Fault]:
    if isinstance(failure, SystematicFailure):
        for trial in range(min(failure.count_cases(channels.size), _MOST_CASES)):
            yield from failure.draw_case(channels, trial)
        return
    for number in range(_DRAWS):
        yield from failure.draw(channels, _generator(f"failure {number}"))


def _generator(name: str) -> "Generator":
    return randomness.generator("effects of faults", name)


def classify_effect(effect: Filter, channels: Channels) -> str:
    """Return what a filter does to readings from its onset on; ``ENDS`` if it cannot be tried."""
    span = channels.high - channels.low
    span = np.where(np.isfinite(span), span, 1.0)
    middle = np.where(np.isfinite(channels.low), channels.low, 0.0) + span / 2.0
    step = _STEP * span
    try:
        same, other = (_apply(effect, channels, middle, each) for each in (0.0 * step, step))
    except Exception:
        return ENDS
    acted = (same != middle).any(axis=0) | (other[1:] != middle + step).any(axis=0)
    if not acted.any() or np.array_equal(same[1:, acted], other[1:, acted], equal_nan=True):
        return ENDS if acted.any() else ALTERS
    error = np.abs(np.where(np.isnan(same), middle + span, same) - middle)[:, acted] / span[acted]
    early, late = error[:_EARLY], error[-len(error) // 3 :]
    chance = 3.0 * late.std() / np.sqrt(early.size)
    return GROWS if late.mean() > 2.0 * early.mean() + chance + 1e-9 else ALTERS


def _apply(effect: Filter, channels: Channels, middle: Array, step: Array) -> Array:
    """Return the samples (n, channels) of a constant signal that makes a step after the onset.

    The filter acts from the second sample on, so that it may keep that one.
    """
    rng = _generator("filter")
    onset = np.full(channels.size, _PERIOD_S)
    parameters, memory = effect.start(channels, onset, rng)
    samples = np.empty((_SAMPLES, channels.size))
    for number in range(-1, _SAMPLES):
        values = middle + (step if number > 0 else 0.0)
        effect.rule(parameters, memory, rng, values, (number + 1) * _PERIOD_S)
        if number >= 0:
            samples[number] = values
    return samples
