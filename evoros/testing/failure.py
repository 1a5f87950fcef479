"""Conformance tests for failure models."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from evoros.base.rng import generator
from evoros.failure.protocol import (
    AdaptiveFailure,
    Case,
    Failure,
    Fault,
    SystematicFailure,
    Trigger,
)
from evoros.filter.protocol import READINGS, SIGNALS, Channels, Filter
from evoros.testing.filter import HIGH_M, LOW_M
from evoros.testing.part import PartSuite
from evoros.testing.rules import PERIOD_S

DRAWS, TRIALS, GENERATIONS = 8, 4, 6


def place_sensors(count: int) -> Channels:
    """Return the channels of ``count`` sonars in a row, 2 cm apart."""
    position = np.zeros((count, 3))
    position[:, 0] = 0.02 * np.arange(count)
    return Channels(np.full(count, LOW_M), np.full(count, HIGH_M), position, PERIOD_S)


def check_faults(faults: tuple[Fault, ...], count: int, parts: Sequence[str] = ()) -> None:
    """Check that faults have a filter, and an onset for each sensor or for the failing part."""
    assert isinstance(faults, tuple), f"faults must be a tuple, not {faults!r}"
    for fault in faults:
        signal, part, shape = fault.signal, fault.part, fault.onset.shape
        assert isinstance(fault.filter, Filter), f"{fault.filter!r} must be a Filter"
        assert signal in SIGNALS, f"a fault's signal must be one of {SIGNALS}, not {signal!r}"
        assert isinstance(fault.trigger, Trigger), f"{fault.trigger!r} must be a Trigger"
        assert signal == READINGS or part in parts, f"{part!r} must be one of the parts, {parts}"
        length, each = (count, "sensor") if signal == READINGS else (1, part)
        assert shape == (length,), f"there must be one onset per {each} (shape: {shape})"
        assert fault.onset.dtype == np.float64, f"the onset must be float64, not {fault.onset!r}"
        assert (fault.onset >= 0).all(), f"onset times must not be negative or NaN: {fault.onset}"


def check_case(case: Case, count: int) -> None:
    """Check that a case has a time for each of its sensors, which are among the first ``count``."""
    assert {*case.sensors} <= {*range(count)}, f"sensors must be from 0 to {count - 1}: {case}"
    assert len(case.times_s) == len(case.sensors), f"there must be a time for each sensor: {case}"
    possible = all(0 <= time < np.inf for time in case.times_s)
    assert possible, f"times must be finite and not negative: {case}"


class FailureSuite(PartSuite):
    """Conformance tests for a failure model."""

    part: Failure
    protocol = Failure
    counts = range(7)  # numbers of sensors for which failures are drawn

    def use(self, part: Any, seed: int) -> Iterator[Any]:
        """Draw the faults of several missions, for robots with increasing numbers of sensors."""
        for count in self.counts:
            for draw in range(DRAWS):
                channels = self.lend(place_sensors(count))
                yield part.draw(channels, generator(f"{seed} {draw}", "failure"))

    def test_faults_cover_all_sensors(self) -> None:
        """Each fault has a filter, and an onset for each sensor or for the failing part."""
        for count in self.counts:
            for draw in range(DRAWS):
                rng = generator(f"{draw}", "failure")
                check_faults(self.part.draw(place_sensors(count), rng), count, self.part.parts)


class SystematicFailureSuite(FailureSuite):
    """Conformance tests for a failure model with countable cases."""

    part: SystematicFailure
    protocol = SystematicFailure

    def use(self, part: SystematicFailure, seed: int) -> Iterator[Any]:
        """Yield the faults of drawn missions, and of several cases."""
        yield from super().use(part, seed)
        for count in self.counts:
            for number in range(min(part.count_cases(count), TRIALS)):
                yield part.state_case(count, number)

    def test_cases_are_different_and_of_the_robots_sensors(self) -> None:
        """All cases differ, and contain only sensors that exist."""
        for count in self.counts:
            cases = self.part.count_cases(count)
            assert cases >= 1, f"there must be a case for a robot with {count} sensors"
            stated = [self.part.state_case(count, number) for number in range(min(cases, 200))]
            assert len(set(stated)) == len(stated), f"two cases for {count} sensors are equal"
            for case in stated:
                check_case(case, count)


class AdaptiveFailureSuite(FailureSuite):
    """Conformance tests for a failure model that adapts its cases to the designs of a run."""

    part: AdaptiveFailure
    protocol = AdaptiveFailure

    def use(self, part: AdaptiveFailure, seed: int) -> Iterator[Any]:
        """Adapt the cases over several generations of random scores; yield them."""
        yield from super().use(part, seed)
        for count in self.counts:
            adversary = part.start(count, TRIALS, generator(f"{seed}", "adversary"))
            luck = generator(f"{seed}", "scores")
            for _ in range(GENERATIONS):
                yield adversary.list_cases()
                # some designs may have been tested in only some of the cases
                met = {i: int(luck.random() * (TRIALS + 1)) for i in range(3)}
                scores = {
                    i: {int(place): float(luck.random()) for place in luck.permutation(TRIALS)[:n]}
                    for i, n in met.items()
                }
                adversary.tell(self.lend(scores))

    def test_each_trial_has_a_case_of_the_robots_sensors(self) -> None:
        """Cases contain only sensors that exist, each with a time, for any scores."""
        for count in self.counts:
            adversary = self.part.start(count, TRIALS, generator("", "adversary"))
            luck = generator("", "scores")
            for _ in range(GENERATIONS):
                cases = adversary.list_cases()
                assert len(cases) == TRIALS, f"there must be a case for each of the {TRIALS} trials"
                for case in cases:
                    check_case(case, count)
                adversary.tell({1: dict(enumerate(luck.random(TRIALS).tolist())), 2: {}})
