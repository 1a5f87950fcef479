"""Failures: which sensors fail how often, when, and that equal keys mean equal draws."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from bundled_parts import configured, every, find_other_defaults, kinds
from helpers import ROOT
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.rng import generator
from evoros.failure.battery import BatteryFailure
from evoros.failure.combined import CombinedFailure
from evoros.failure.independent import IndependentFailure
from evoros.failure.none import NoFailure
from evoros.failure.onset.course import CourseOnset
from evoros.failure.onset.protocol import Onset
from evoros.failure.onset.time import TimeOnset
from evoros.failure.part import SPOILED, PartFailure
from evoros.failure.protocol import Failure, Fault, Trigger
from evoros.failure.random import RandomFailure
from evoros.failure.spatial import SpatialFailure
from evoros.filter.gaussian_noise import GaussianNoise
from evoros.filter.protocol import Channels
from evoros.filter.silence import Silence
from evoros.filter.stuck import Stuck
from evoros.testing import AdaptiveFailureSuite, FailureSuite, SystematicFailureSuite
from evoros.testing.part import DescriptionSuite

BAD: dict[str, list[dict[str, Any]]] = {
    "random": [
        {"count": 0}, {"count": 1.5}, {"earliest_s": -1.0}, {"earliest_s": 81.0},
        {"latest_s": math.inf}, {"effect": "silence"},
    ],
    "spatial": [
        {"earliest_s": 81.0}, {"effect": None}, {"radii_m": []}, {"radii_m": 0.03},
        {"radii_m": [0.06, 0.03, 0.09]}, {"radii_m": [-0.1, 0.03, 0.09]},
        {"probabilities": [1.0, 0.5]}, {"probabilities": [1.0, 0.5, 1.5]},
        {"probabilities": "high"},
    ],
    "independent": [
        {"probability": -0.1}, {"probability": 1.1}, {"earliest_s": 1.0}, {"effect": "silence"},
    ],
    "steering": [
        {"probability": -0.1}, {"probability": 1.1}, {"part": "wheel"}, {"onset": 40.0},
        {"effect": "stuck"},
    ],
    "battery": [
        {"charge_wh": 0.0}, {"charge_wh": -1.0}, {"sd_wh": -1.0}, {"idle_w": -1.0},
        {"idle_w": 0.0, "drive_j_per_m": 0.0},
    ],
    "combined": [{"failures": {"one": Silence()}}, {"failures": [NoFailure()]}],
}  # fmt: skip
unhurried = settings(deadline=None)  # a busy machine is no failure
DRAWS = 3000

seeds = st.integers(0, 2**32 - 1)
coordinates = st.floats(-0.3, 0.3)
places = st.lists(st.tuples(coordinates, coordinates, coordinates), max_size=8)


def sensors(position: Sequence[Sequence[float]] | Array) -> Channels:
    place = np.array(position, dtype=np.float64).reshape(-1, 3)
    n = len(place)
    return Channels(np.full(n, 0.06), np.full(n, 4.5), place, 0.1)


def row(*x: float) -> Channels:
    return sensors([(value, 0.0, 0.0) for value in x])


def onsets(failure: Failure, channels: Channels, draws: int = DRAWS) -> Array:
    """(draws, n) onsets of the failure's single fault, each draw from a key of its own."""
    rows = []
    for k in range(draws):
        (fault,) = failure.draw(channels, generator(f"draw {k}", "failure"))
        rows.append(fault.onset)
    return np.array(rows)


def equal(a: tuple[Fault, ...], b: tuple[Fault, ...]) -> bool:
    return len(a) == len(b) and all(
        x.filter == y.filter and np.array_equal(x.onset, y.onset) for x, y in zip(a, b, strict=True)
    )


def near_share(hits: NDArray[np.bool_], probability: float) -> bool:
    """Five standard errors of a binomial share, the keys being fixed."""
    spread = math.sqrt(probability * (1 - probability) / hits.size)
    return bool(abs(hits.mean() - probability) <= 5 * spread)


def is_uniform(sample: Array, low: float, high: float) -> bool:
    """Kolmogorov-Smirnov, at the level of one false alarm in a million seeds."""
    ordered = (np.sort(sample) - low) / (high - low)
    steps = np.arange(len(ordered) + 1) / len(ordered)
    distance = max((steps[1:] - ordered).max(), (ordered - steps[:-1]).max())
    limit = math.sqrt(math.log(2 / 1e-6) / 2 / len(ordered))
    return bool(ordered.min() >= 0 and ordered.max() <= 1 and distance < limit)


# Every failure that has a YAML


OF_PARTS = ["commands", "drive", "localization", "steering", "wheel"]
"""Failures of other parts than sensors; ``failure.part`` chooses the side of a wheel."""


def test_every_failure_module_has_a_configuration_of_its_name() -> None:
    folder = ROOT / "evoros" / "failure"
    modules = {path.stem for path in folder.glob("*.py")} - {"__init__", "protocol", "case"}
    assert modules - {"trigger", "part"} == set(kinds("failure")) - set(OF_PARTS)
    configurations = {name: configured("failure", name) for name in kinds("failure")}
    parts = {name: one for name, one in configurations.items() if isinstance(one, PartFailure)}
    assert list(parts) == OF_PARTS
    assert {part.part for part in parts.values()} | {"right_wheel"} == set(SPOILED)
    onsets = {path.stem for path in (folder / "onset").glob("*.py")} - {"__init__", "protocol"}
    assert onsets == set(kinds("failure/onset"))


PARTS = [*OF_PARTS, "battery"]


@pytest.mark.parametrize("name", sorted(set(kinds("failure")) - set(PARTS)))
def test_robot_without_sensors_has_no_faults(name: str) -> None:
    assert configured("failure", name).draw(sensors([]), generator("key", "failure")) == ()


class TestDrawnFailures(FailureSuite):
    choose = every(
        "failure", ["combined", "given", "independent", "none", "random", "spatial", *PARTS], BAD
    )


BAD_ONSETS: dict[str, list[dict[str, Any]]] = {
    "time": [{"earliest_s": -1.0}, {"earliest_s": 90.0}],
    "course": [{"earliest": 0.8}, {"latest": 1.1}, {"unit": "km"}],
    "use": [{"per_m": 0.0}],
}


class TestOnsets(DescriptionSuite):
    protocol = Onset
    choose = every("failure/onset", bad_values=BAD_ONSETS)


@pytest.mark.parametrize("name", kinds("failure/onset"))
def test_an_onset_is_an_event_and_a_time_after_it(name: str) -> None:
    trigger, delay = configured("failure/onset", name).draw(generator("mission", "failure"))
    assert 0 <= delay < math.inf
    assert (trigger == Trigger()) == (name == "time")


def test_a_drawn_onset_shifts_no_later_draw() -> None:
    pairs: list[tuple[Onset, Onset]] = [
        (TimeOnset(), TimeOnset(5.0, 5.0)),
        (CourseOnset(), CourseOnset(0.5, 0.5)),
    ]
    for onsets in pairs:
        rngs = [generator("mission", "failure") for _ in onsets]
        for onset, rng in zip(onsets, rngs, strict=True):
            onset.draw(rng)
        assert rngs[0].random() == rngs[1].random()


class TestExhaustiveFailure(SystematicFailureSuite):
    choose = every("failure", ["exhaustive"])


class TestAdversarialFailure(AdaptiveFailureSuite):
    choose = every("failure", ["adversarial"])


@pytest.mark.parametrize("name", ["random", "spatial", "combined"])
def test_drawn_failures_begin_in_the_window_of_the_paper(name: str) -> None:
    for fault in configured("failure", name).draw(row(0.0, 0.1), generator("key", "failure")):
        assert ((fault.onset >= 40) & ((fault.onset < 80) | (fault.onset == math.inf))).all()


def test_defaults_are_what_the_configuration_says() -> None:
    assert find_other_defaults("failure") == ["combined"]  # which by default combines nothing
    assert find_other_defaults("failure/onset") == []


def test_effect_and_parts_are_chosen_on_the_command_line() -> None:
    assert configured("failure", "random", "filter@failure.effect=stuck") == RandomFailure(
        effect=Stuck()
    )
    combined = configured("failure", "combined", "+failure@failure.failures.third=random")
    assert isinstance(combined, CombinedFailure)
    assert list(combined.failures) == ["single", "damage", "third"]


# Nothing


@unhurried
@given(places, seeds)
def test_no_failure_is_no_fault(place: list[tuple[float, float, float]], seed: int) -> None:
    assert NoFailure().draw(sensors(place), np.random.default_rng(seed)) == ()


# Random


def test_one_sensor_fails_uniformly_in_40_to_80_s() -> None:
    n = 5
    drawn = onsets(RandomFailure(), row(*range(n)))
    fails = np.isfinite(drawn)
    assert (fails.sum(axis=1) == 1).all()
    assert all(near_share(fails[:, i], 1 / n) for i in range(n))
    assert is_uniform(drawn[fails], 40, 80)
    assert all(is_uniform(drawn[fails[:, i], i], 40, 80) for i in range(n))


@unhurried
@given(places, st.integers(1, 10), seeds)
def test_as_many_sensors_fail_as_told_or_as_there_are(
    place: list[tuple[float, float, float]], count: int, seed: int
) -> None:
    faults = RandomFailure(count=count).draw(sensors(place), np.random.default_rng(seed))
    failing = sum(int(np.isfinite(fault.onset).sum()) for fault in faults)
    assert failing == min(count, len(place))


def test_every_pair_of_sensors_is_as_likely_at_independent_times() -> None:
    drawn = onsets(RandomFailure(count=2), row(0, 1, 2, 3))
    fails = np.isfinite(drawn)
    for i in range(4):
        for j in range(i):
            assert near_share(fails[:, i] & fails[:, j], 1 / 6)
    times: Array = drawn[fails].reshape(-1, 2)
    assert abs(np.corrcoef(times[:, 0], times[:, 1])[0, 1]) < 5 / math.sqrt(len(times))


@unhurried
@given(seeds, st.integers(1, 6), st.integers(1, 6))
def test_robots_that_share_a_key_face_the_same_time_of_failure(
    seed: int, few: int, many: int
) -> None:
    for failure in (RandomFailure(), SpatialFailure()):
        times = set()
        for n in (few, many):
            (fault,) = failure.draw(row(*range(n)), np.random.default_rng(seed))
            times |= set(fault.onset[np.isfinite(fault.onset)].tolist())
        assert len(times) == 1


@unhurried
@given(seeds, st.integers(1, 9), st.integers(0, 6), st.integers(0, 6))
def test_number_of_sensors_changes_nothing_that_is_drawn_later(
    seed: int, count: int, few: int, many: int
) -> None:
    later = set()
    for n in (few, many):
        rng = np.random.default_rng(seed)
        RandomFailure(count=count).draw(row(*range(n)), rng)
        later.add(rng.random())
    assert len(later) == 1


@unhurried
@given(places, places, seeds)
def test_places_of_sensors_change_no_random_failure(
    one: list[tuple[float, float, float]], two: list[tuple[float, float, float]], seed: int
) -> None:
    n = min(len(one), len(two))
    a, b = (
        RandomFailure(count=2).draw(sensors(place[:n]), np.random.default_rng(seed))
        for place in (one, two)
    )
    assert equal(a, b)


# Independent


def test_each_sensor_fails_with_the_same_probability_whatever_the_others_do() -> None:
    drawn = onsets(IndependentFailure(0.3, 10.0, 20.0), row(0, 0, 1))
    fails = np.isfinite(drawn)
    assert all(near_share(fails[:, i], 0.3) for i in range(3))
    assert all(near_share(fails[:, i] & fails[:, j], 0.09) for i, j in ((0, 1), (0, 2), (1, 2)))
    assert near_share(fails[:, 0] & fails[:, 1] & fails[:, 2], 0.027)
    assert is_uniform(drawn[fails], 10, 20)


@unhurried
@given(seeds, st.integers(0, 6), st.integers(0, 6))
def test_drop_out_is_from_the_start_and_that_of_the_first_sensors_is_shared(
    seed: int, few: int, more: int
) -> None:
    (one, two) = (
        [
            fault.onset
            for fault in IndependentFailure().draw(row(*range(n)), np.random.default_rng(seed))
        ]
        for n in (few, few + more)
    )
    assert all(set(onset.tolist()) <= {0.0, math.inf} for onset in (*one, *two))
    assert all(np.array_equal(a, b[:few]) for a, b in zip(one, two, strict=False))
    for probability, count in ((0.0, 0), (1.0, few)):
        faults = IndependentFailure(probability).draw(row(*range(few)), np.random.default_rng(seed))
        assert sum(int(np.isfinite(fault.onset).sum()) for fault in faults) == count


# Spatial


def test_damage_reaches_as_far_and_as_surely_as_the_paper_says() -> None:
    # Every draw is asked where its centre was by sensors far apart, each with neighbours in the
    # middle of each ring, beyond the last, and straight above.
    offsets = [(0, 0), (0.029, 0), (0.045, 0), (0.075, 0), (0.091, 0), (0, 0.045)]
    clusters = 40
    place = [(k * 1.0 + dx, 0.0, dz) for k in range(clusters) for dx, dz in offsets]
    drawn = onsets(SpatialFailure(), sensors(place))
    hits = np.isfinite(drawn).reshape(DRAWS, clusters, len(offsets))
    assert (hits.any(axis=2).sum(axis=1) == 1).all()  # damage stays in one cluster
    # The sensor at the origin can be the centre itself, and so can the others; keep the draws
    # whose generator, replayed, puts it at the origin of its cluster.
    picks = [int(generator(f"draw {k}", "failure").random() * len(place)) for k in range(DRAWS)]
    chosen = np.array([hits[k, p // 6] for k, p in enumerate(picks) if p % 6 == 0])
    assert chosen[:, :2].all()
    assert near_share(chosen[:, 2], 2 / 3)
    assert near_share(chosen[:, 3], 1 / 3)
    assert not chosen[:, 4].any()
    assert near_share(chosen[:, 5], 2 / 3)
    independent = near_share(chosen[:, 2] & chosen[:, 5], 4 / 9)
    assert independent


def test_two_sensors_fail_together_by_their_distance() -> None:
    for distance, probability in [(0.02, 1.0), (0.05, 2 / 3), (0.08, 1 / 3), (0.1, 0.0)]:
        hits = np.isfinite(onsets(SpatialFailure(), row(0.0, distance)))
        assert hits.any(axis=1).all()
        assert near_share(hits[:, 0] & hits[:, 1], probability)


def test_centre_of_damage_is_uniform_and_so_is_its_time() -> None:
    n = 4
    drawn = onsets(SpatialFailure(), row(*range(n)))
    fails = np.isfinite(drawn)
    assert (fails.sum(axis=1) == 1).all()
    assert all(near_share(fails[:, i], 1 / n) for i in range(n))
    assert is_uniform(drawn[fails], 40, 80)


@unhurried
@given(places.filter(bool), seeds)
def test_damage_happens_at_one_time_and_within_the_last_radius(
    place: list[tuple[float, float, float]], seed: int
) -> None:
    (fault,) = SpatialFailure().draw(sensors(place), np.random.default_rng(seed))
    hit = np.isfinite(fault.onset)
    assert len(set(fault.onset[hit].tolist())) == 1
    assert 40 <= fault.onset[hit][0] < 80
    position = np.array(place)
    distance = np.linalg.norm(position[:, None] - position[None], axis=2)
    assert any(
        hit[distance[c] <= 0.03 - 1e-9].all() and not hit[distance[c] > 0.09 + 1e-9].any()
        for c in range(len(place))
    )


@unhurried
@given(places, seeds)
def test_certain_damage_hits_exactly_those_within_reach(
    place: list[tuple[float, float, float]], seed: int
) -> None:
    everywhere = SpatialFailure(radii_m=[2.0], probabilities=[1.0])
    nowhere = SpatialFailure(radii_m=[2.0], probabilities=[0.0])
    for failure, share in ((everywhere, len(place)), (nowhere, 0)):
        faults = failure.draw(sensors(place), np.random.default_rng(seed))
        assert sum(int(np.isfinite(fault.onset).sum()) for fault in faults) == share


def test_a_sensor_exactly_on_a_radius_is_within_it() -> None:
    """A quarter of a metre has no rounding."""
    failure = SpatialFailure(radii_m=[0.25, 0.5], probabilities=[1.0, 0.0])
    for seed in range(20):
        (fault,) = failure.draw(row(0.0, 0.25), np.random.default_rng(seed))
        assert np.isfinite(fault.onset).all()


# Combined


def test_adding_a_failure_never_shifts_another() -> None:
    channels = row(0.0, 0.02, 0.05, 0.08, 0.3)
    one, two = RandomFailure(), SpatialFailure(effect=GaussianNoise(1.0))
    for k in range(50):

        def drawn(key: str = str(k), **failures: Failure) -> tuple[Fault, ...]:
            return CombinedFailure(failures).draw(channels, generator(key, "failure"))

        both = drawn(one=one, two=two)
        assert equal(both, drawn(one=one) + drawn(two=two))
        assert equal(drawn(two=two, one=one), both[::-1])
        assert equal(drawn(zero=NoFailure(), one=one, more=two, two=two)[:1], both[:1])


def test_failures_of_the_same_kind_are_drawn_independently() -> None:
    failure = CombinedFailure({"a": RandomFailure(), "b": RandomFailure()})
    times, same = [], []
    for k in range(DRAWS):
        a, b = failure.draw(row(0, 1, 2, 3), generator(f"draw {k}", "failure"))
        times.append((a.onset.min(), b.onset.min()))
        same.append(np.argmin(a.onset) == np.argmin(b.onset))
    assert near_share(np.array(same), 1 / 4)
    assert abs(np.corrcoef(np.array(times).T)[0, 1]) < 5 / math.sqrt(DRAWS)


# Battery


def test_a_battery_lasts_for_its_charge() -> None:
    (fault,) = BatteryFailure(2.0, 0.0, 15.0, 60.0).draw(row(), generator("key", "failure"))
    amount, per_s, per_m = fault.trigger.values
    assert amount / per_s == 2.0 * 3600 / 15.0  # [s] idle
    assert amount / per_m == 120.0  # [m], if only driving took energy


# Names of faults


@pytest.mark.parametrize(
    ("name", "stream"),
    [
        ("bias", "Bias"),
        ("delay", "Delay"),
        ("dropout", "Dropout"),
        ("gaussian_noise", "GaussianNoise"),
        ("hold", "Hold"),
        ("pose_noise", "PoseNoise"),
        ("silence", "Silence"),
        ("stuck", "Stuck"),
    ],
)
def test_the_stream_and_the_column_of_a_fault_keep_their_names(name: str, stream: str) -> None:
    """They decide what a run draws and records, so they are part of its format."""
    failure = configured("failure", "random", f"filter@failure.effect={name}")
    (fault,) = failure.draw(row(0.0, 0.1), generator("key", "failure"))
    assert (fault.name, fault.effect) == (stream, stream.lower())


def test_a_class_can_be_renamed_without_another_run() -> None:
    class Renamed(Silence):
        pass

    assert Fault(Renamed(), np.zeros(1)).name == "Silence"
    assert Fault(Renamed(), np.zeros(1), "front.Silence").effect == "silence"
