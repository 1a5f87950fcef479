"""Conformance tests for filters."""

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from evoros.base.arrays import NO_VALUES, POSE_SIZE, Array
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.compilation.named_rules import bind
from evoros.compilation.rules import FILTER
from evoros.filter.protocol import EFFECTS, FILTER_ARGUMENTS, POSE, Channels, Filter
from evoros.testing.part import bits
from evoros.testing.rules import PERIOD_S, RuleCase, RuleSuite

LOW_M, HIGH_M = 0.06, 4.5
NEVER = math.inf


def sonar_channels(count: int) -> Channels:
    """Return the channels of ``count`` sonars."""
    return Channels(np.full(count, LOW_M), np.full(count, HIGH_M), np.zeros((count, 3)), PERIOD_S)


def pose_channels() -> Channels:
    """Return the channels of a localized pose, which are unlimited."""
    unlimited = np.full(POSE_SIZE, math.inf)
    return Channels(-unlimited, unlimited, np.zeros((POSE_SIZE, 3)), PERIOD_S, signal=POSE)


def play(
    part: Filter,
    recording: Array,
    onset: Array | None = None,
    seed: int = 0,
    channels: Channels | None = None,
) -> Array:
    """Return the output of a filter, tick by tick, for a recording of the ``channels``."""
    ticks, count = recording.shape
    channels = channels or sonar_channels(count)
    rng = generator(str(seed), part.name)
    started = part.start(channels, np.zeros(count) if onset is None else onset, rng)
    rule = bind(part.rule, FILTER_ARGUMENTS, started)
    output = recording.copy()
    for tick in range(ticks):
        rule(rng, NO_VALUES, output[tick], tick * channels.period)
    return output


def draw_recording(seed: int) -> Array:
    """Draw 30 samples of four values, some at maximum range and some silent."""
    rng = np.random.default_rng(seed)
    recording = rng.uniform(LOW_M, HIGH_M, (30, POSE_SIZE))
    recording[rng.random(recording.shape) < 0.2] = math.nan
    recording[rng.random(recording.shape) < 0.2] = HIGH_M
    return recording


class FilterSuite(RuleSuite):
    """Conformance tests for a filter, on sonar readings or, if it rejects these, on poses."""

    part: Filter
    protocol = Filter
    signature: ClassVar[Any] = FILTER
    fills = "values"

    @cached_property
    def channels(self) -> Channels:
        """Four channels to filter; override if the filter requires others."""
        sonars = sonar_channels(POSE_SIZE)
        try:
            self.part.start(sonars, np.zeros(POSE_SIZE), generator("", ""))
        except InputError:
            return pose_channels()
        return sonars

    def start_rules(self, part: Filter, seed: int) -> Sequence[RuleCase]:
        """Start the filter with onsets at the start, later, and never."""
        rng = generator(str(seed), part.name)
        onset = rng.choice([0.0, 0.25, NEVER], POSE_SIZE)
        started = part.start(self.lend(self.channels), self.lend(onset), rng)
        return [RuleCase(part.rule, FILTER_ARGUMENTS, started, {"values": POSE_SIZE})]

    def filter(self, recording: Array, seed: int, *onset: float) -> Array:
        """Return the output of the filter, which acts from the start unless ``onset`` is given."""
        times = np.array(onset or [0.0] * POSE_SIZE)
        return play(self.part, recording, times, seed, self.channels)

    def test_name_and_effect_can_be_recorded(self) -> None:
        """The name is a non-empty string, and the effect is one of the three permitted effects."""
        assert isinstance(self.part.name, str), "name must be a string"
        assert self.part.name, "name must not be empty"
        assert self.part.effect in EFFECTS, f"effect must be one of {EFFECTS}"

    def test_channels_without_an_onset_stay_untouched(self) -> None:
        """Channels with an infinite onset are unchanged."""
        for seed in range(5):
            recording = draw_recording(seed)
            output = self.filter(recording, seed, 0.0, NEVER, 1.0, NEVER)
            assert bits(output[:, [1, 3]]) == bits(recording[:, [1, 3]])

    def test_values_before_the_onset_stay_untouched(self) -> None:
        """Values before the onset are unchanged."""
        recording = draw_recording(3)
        # The onset is between two samples, so that rounding of times does not matter.
        output = self.filter(recording, 3, *[0.95] * POSE_SIZE)
        assert bits(output[:10]) == bits(recording[:10])

    def test_it_acts_from_the_sample_of_its_onset_on(self) -> None:
        """An onset at the time of a sample affects that sample, as an onset just before does."""
        for seed in range(5):
            recording, time = draw_recording(seed), 10 * self.channels.period
            exact = self.filter(recording, seed, *[time] * POSE_SIZE)
            before = self.filter(recording, seed, *[time - 1e-9] * POSE_SIZE)
            assert np.allclose(exact, before, rtol=0.0, atol=1e-6, equal_nan=True)

    def test_lasting_silence_stays_silent(self) -> None:
        """A filter never fills in readings if all are missing."""
        output = self.filter(np.full((20, POSE_SIZE), math.nan), 1)
        assert np.isnan(output).all(), "the filter must not invent readings if all are missing"

    def test_values_are_finite_or_silent(self) -> None:
        """Filtered values are finite or NaN."""
        for seed in range(5):
            output = self.filter(draw_recording(seed), seed)
            assert not np.isinf(output).any(), "filtered values must be finite or NaN"

    def test_a_channel_does_not_shift_the_draws_of_another(self) -> None:
        """Silent and unchanged channels use as many random numbers as others."""
        recording = draw_recording(7)
        output, silenced = self.filter(recording, 7), recording.copy()
        silenced[:, 0] = math.nan
        assert bits(self.filter(silenced, 7)[:, 1:]) == bits(output[:, 1:])
        later = self.filter(recording, 7, NEVER, 0.0, 0.0, 0.0)
        assert bits(later[:, 1:]) == bits(output[:, 1:])
