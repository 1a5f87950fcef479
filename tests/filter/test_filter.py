"""Filters: what each does to the values, exactly or in distribution."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from bundled_parts import every, find_other_defaults, kinds
from helpers import ROOT
from hypothesis import given, settings
from hypothesis import strategies as st

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.filter.bias import Bias
from evoros.filter.delay import Delay
from evoros.filter.drift import Drift
from evoros.filter.dropout import Dropout
from evoros.filter.gaussian_noise import GaussianNoise
from evoros.filter.hold import Hold
from evoros.filter.mask import Mask
from evoros.filter.pose_noise import PoseNoise
from evoros.filter.protocol import Filter
from evoros.filter.scale import Scale
from evoros.filter.silence import Silence
from evoros.filter.stuck import Stuck
from evoros.testing import FilterSuite
from evoros.testing.filter import HIGH_M, LOW_M, NEVER, play, pose_channels, sonar_channels
from evoros.testing.rules import PERIOD_S

LOW, HIGH, PERIOD = LOW_M, HIGH_M, PERIOD_S
BAD: dict[str, list[dict[str, Any]]] = {
    "gaussian_noise": [{"sigma_m": -0.1}, {"sigma_m": math.nan}, {"sigma_m": "0.1"}],
    "bias": [{"offset_m": math.inf}, {"sd_m": -1}],
    "delay": [{"delay_s": -0.1}, {"delay_s": math.inf}],
    "constant": [{"value": math.inf}, {"value": "0"}],
    "mask": [{"scan": 0}, {"beams": [[2, 1]]}, {"beams": [3]}, {"beams": [[-1, 0]]}],
    "limit": [{"limit": -0.1}, {"limit": math.nan}],
    "pose_jump": [{"distance_m": -1.0}, {"direction_deg": "north"}, {"yaw_deg": math.inf}],
    "pose_drift": [{"rate_mps": -0.1}, {"longest_s": 0.0}, {"yaw_rate_dps": None}],
    "hold": [{"period_s": 0.0}, {"period_s": None}],
    "dropout": [{"probability": 1.1}, {"duration_s": -1.0}, {"lost": "forgotten"}],
    "pose_noise": [
        {"sigma_position_m": -1.0}, {"sigma_yaw_deg": True}, {"sigma_speed_mps": math.nan}
    ],
}  # fmt: skip
unhurried = settings(deadline=None)  # a busy machine is no failure

seeds = st.integers(0, 2**32 - 1)
ranges = st.one_of(st.floats(LOW, HIGH), st.just(HIGH), st.just(LOW), st.just(math.nan))


@st.composite
def recordings(draw: st.DrawFn) -> Array:
    """(ticks, n) readings as they may come: in range, at its ends, silent."""
    n, ticks = draw(st.integers(0, 4)), draw(st.integers(1, 25))
    rows = draw(st.lists(st.lists(ranges, min_size=n, max_size=n), min_size=ticks, max_size=ticks))
    return np.array(rows, dtype=np.float64).reshape(ticks, n)


def same(a: Array, b: Array) -> bool:
    """Equal bit for bit, any NaN being equal to any NaN."""
    return np.array_equal(a, b, equal_nan=True)


# Every filter that has a YAML


def test_every_filter_module_has_a_configuration_of_its_name_and_defaults() -> None:
    package = ROOT / "evoros" / "filter"
    modules = {path.stem for path in package.glob("*.py")} - {"__init__", "protocol"}
    assert modules == set(kinds("filter"))
    assert find_other_defaults("filter") == []


class TestBundledFilters(FilterSuite):
    choose = every("filter", bad_values=BAD, overrides={"constant": ["filter.value=0.3"]})


@unhurried
@given(recordings(), st.integers(0, 3), st.integers(0, 3))
def test_a_mask_hides_its_beams_of_each_scan(rows: Array, first: int, more: int) -> None:
    last = min(first + more, 3)
    scans = np.concatenate([rows[:, :1]] * 8, axis=1) if rows.shape[1] else np.zeros((1, 8))
    output = play(Mask(scan=4, beams=[[first, last]]), scans, np.zeros(8), 0, sonar_channels(8))
    masked = [first <= beam % 4 <= last for beam in range(8)]
    assert same(output[:, masked], np.where(np.isnan(scans[:, masked]), math.nan, HIGH))
    assert same(output[:, np.logical_not(masked)], scans[:, np.logical_not(masked)])


@pytest.mark.parametrize(("scan", "beams"), [(3, []), (4, [[2, 4]])])
def test_a_mask_of_another_scan_is_refused(scan: int, beams: list[list[int]]) -> None:
    with pytest.raises(
        InputError,
        match=r"Mask\.(scan: the number of readings, 8, is not a multiple of 3|beams: must be)",
    ):
        Mask(scan, beams).start(sonar_channels(8), np.zeros(8), np.random.default_rng(0))


# Gaussian noise and bias


@unhurried
@given(recordings(), seeds, st.floats(0, 3), st.sampled_from(["noise", "bias", "scale"]))
def test_errors_stay_within_the_limits_and_spare_values_at_the_maximum(
    recording: Array, seed: int, size: float, kind: str
) -> None:
    noise, bias, scale = GaussianNoise(size), Bias(-size, size), Scale(-size, size)
    filters: dict[str, Filter] = {"noise": noise, "bias": bias, "scale": scale}
    filter_ = filters[kind]
    output = play(filter_, recording, seed=seed)
    heard = ~np.isnan(recording)
    assert (np.isnan(output) == ~heard).all()
    assert ((output[heard] >= LOW) & (output[heard] <= HIGH)).all()
    assert (output[recording == HIGH] == HIGH).all()


def within(statistic: float, expected: float, standard_error: float) -> bool:
    """Five standard errors: a false alarm in two million seeds, and the seeds are fixed."""
    return abs(statistic - expected) < 5 * standard_error


@pytest.mark.parametrize("sigma", [0.005, 0.2])
def test_gaussian_noise_has_its_standard_deviation_and_no_memory(sigma: float) -> None:
    ticks, n = 4000, 3
    noise = play(GaussianNoise(sigma), np.full((ticks, n), 2.0), seed=4) - 2.0
    size = noise.size
    assert within(noise.mean(), 0.0, sigma / math.sqrt(size))
    assert within(noise.std(), sigma, sigma / math.sqrt(2 * size))
    for a, b in [(noise[1:], noise[:-1]), (noise[:, 1:], noise[:, :-1])]:  # in time, in space
        correlation = np.corrcoef(a.ravel(), b.ravel())[0, 1]
        assert within(correlation, 0.0, 1 / math.sqrt(a.size))


def test_bias_is_constant_in_time_and_spread_over_channels() -> None:
    n, offset, sd = 4000, 0.3, 0.1
    error = play(Bias(offset, sd), np.full((6, n), 2.0), seed=8) - 2.0
    assert (error == error[0]).all()
    assert within(error[0].mean(), offset, sd / math.sqrt(n))
    assert within(error[0].std(), sd, sd / math.sqrt(2 * n))


def test_drift_grows_at_its_rate_from_the_onset_to_its_limit() -> None:
    recording, onset = np.full((40, 2), 2.0), np.array([0.0, 1.0])
    error = play(Drift(-0.5, 0.0, limit_m=0.75), recording, onset) - 2.0
    times = PERIOD * np.arange(40)[:, None]
    assert np.allclose(error, -np.clip(0.5 * (times - onset), 0.0, 0.75))


def test_bias_without_spread_is_the_offset_exactly() -> None:
    assert same(play(Bias(-0.25, 0.0), np.full((3, 2), 2.0)), np.full((3, 2), 1.75))


# Pose noise


def test_pose_noise_has_its_standard_deviations() -> None:
    ticks = 5000
    filter_ = PoseNoise(sigma_position_m=0.5, sigma_yaw_deg=3.0, sigma_speed_mps=0.25)
    recording = np.tile([1.0, -2.0, 3.0, 0.3], (ticks, 1))
    noise = play(filter_, recording, seed=1, channels=pose_channels()) - recording
    expected = np.array([0.5, 0.5, math.radians(3.0), 0.25])
    assert (np.abs(noise.std(axis=0) - expected) < 5 * expected / math.sqrt(2 * ticks)).all()
    assert (np.abs(noise.mean(axis=0)) < 5 * expected / math.sqrt(ticks)).all()
    assert (np.abs(np.corrcoef(noise.T) - np.eye(4)) < 5 / math.sqrt(ticks)).all()


@pytest.mark.parametrize("n", [0, 3, 4, 6])
def test_pose_noise_refuses_range_sensors(n: int) -> None:
    with pytest.raises(InputError, match="localization"):
        PoseNoise().start(sonar_channels(n), np.zeros(n), np.random.default_rng(0))


# Delay


@unhurried
@given(recordings(), st.integers(0, 8), st.sampled_from([0.1, 0.05, 1 / 30, 0.02]))
def test_delay_is_a_shift(recording: Array, samples: int, period: float) -> None:
    channels = replace(sonar_channels(recording.shape[1]), period=period)
    output = play(Delay(samples * period), recording, channels=channels)
    shifted = [recording[max(0, k - samples)] for k in range(len(recording))]
    assert same(output, np.array(shifted).reshape(recording.shape))


@unhurried
@given(recordings(), st.integers(0, 1000))
def test_delay_gives_the_newest_sample_that_has_arrived(recording: Array, delay_ms: int) -> None:
    delay_s = delay_ms / 1000
    output = play(Delay(delay_s), recording)
    for k in range(len(recording)):
        arrived = [j for j in range(k + 1) if j * PERIOD + delay_s <= k * PERIOD + 1e-6]
        assert same(output[k], recording[max(arrived, default=0)])


def test_delay_begins_at_its_onset_with_what_was_sampled_before() -> None:
    recording = np.arange(10.0)[:, None]
    output = play(Delay(3 * PERIOD), recording, np.array([4.5 * PERIOD]))
    assert output.ravel().tolist() == [0, 1, 2, 3, 4, 2, 3, 4, 5, 6]


# Hold


@unhurried
@given(recordings(), st.integers(1, 8), st.sampled_from([0.1, 0.05, 1 / 30, 0.02]))
def test_hold_repeats_the_first_sample_of_each_period(
    recording: Array, samples: int, period: float
) -> None:
    channels = replace(sonar_channels(recording.shape[1]), period=period)
    output = play(Hold(samples * period), recording, channels=channels)
    held = [recording[k - k % samples] for k in range(len(recording))]
    assert same(output, np.array(held).reshape(recording.shape))


def test_hold_between_two_samples_keeps_its_mean_rate() -> None:
    recording = np.arange(21.0)[:, None]
    output = play(Hold(2.5 * PERIOD), recording).ravel()
    assert np.unique(output).tolist() == [0, 3, 5, 8, 10, 13, 15, 18, 20]


# Dropout


@pytest.mark.parametrize(("probability", "samples"), [(0.0, 1), (0.1, 1), (0.05, 7), (1.0, 3)])
def test_dropout_starts_outages_at_its_rate(probability: float, samples: int) -> None:
    ticks, n = 4000, 3
    filter_ = Dropout(probability, duration_s=samples * PERIOD)
    lost = np.isnan(play(filter_, np.full((ticks, n), 2.0), seed=6))
    started, chances = 0, 0
    for column in lost.T:
        k = 0
        while k < ticks:
            chances += 1
            started += column[k]
            assert column[k] == column[k : k + samples].all()  # never less than a whole outage
            k += samples if column[k] else 1
    spread = math.sqrt(probability * (1 - probability) / chances)
    assert abs(started / chances - probability) <= 5 * spread


@pytest.mark.slow
@unhurried
@given(recordings(), seeds, st.floats(0, 1), st.floats(0, 0.5))
def test_dropout_can_keep_the_last_value_that_arrived(
    recording: Array, seed: int, probability: float, duration_s: float
) -> None:
    # With the same luck, what is silent one way is the last value the other way. Marking each
    # sample with its number tells the lost ones from those that were silent already.
    marked = np.arange(recording.size, dtype=np.float64).reshape(recording.shape)
    lost = np.isnan(play(Dropout(probability, duration_s, "silent"), marked, seed=seed))
    silent = play(Dropout(probability, duration_s, "silent"), recording, seed=seed)
    kept = play(Dropout(probability, duration_s, "last"), recording, seed=seed)
    last = np.full(recording.shape[1], math.nan)
    for k in range(len(recording)):
        last = np.where(lost[k], last, recording[k])
        assert same(kept[k], last)
        assert same(silent[k], np.where(lost[k], math.nan, recording[k]))


# Stuck and silence

onsets = st.one_of(st.just(0.0), st.just(NEVER), st.floats(0, 3))


@unhurried
@given(recordings(), st.lists(onsets, min_size=4, max_size=4))
def test_stuck_repeats_the_value_of_its_onset(recording: Array, times: list[float]) -> None:
    ticks, n = recording.shape
    output = play(Stuck(), recording, np.array(times[:n]))
    for i in range(n):
        acting = [k for k in range(ticks) if k * PERIOD >= times[i]]
        first = acting[0] if acting else ticks
        assert same(output[:first, i], recording[:first, i])
        if acting:
            assert same(output[first:, i], np.full(ticks - first, recording[first, i]))


@unhurried
@given(recordings(), st.lists(onsets, min_size=4, max_size=4))
def test_silence_is_nan_exactly_from_its_onset_on(recording: Array, times: list[float]) -> None:
    ticks, n = recording.shape
    output = play(Silence(), recording, np.array(times[:n]))
    acting = np.arange(ticks)[:, None] * PERIOD >= np.array(times[:n])
    assert np.isnan(output[acting]).all()
    assert same(output[~acting], recording[~acting])
