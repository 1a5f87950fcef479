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
    """Require a filter, and a time for each sensor or for the part that fails."""
    assert isinstance(faults, tuple), f"faults must be a tuple, not {faults!r}"
    for fault in faults:
        assert isinstance(fault.filter, Filter), f"{fault.filter!r} of a fault must be a filter"
        assert fault.signal in SIGNALS, f"the signal must be one of {SIGNALS}: {fault.signal!r}"
        assert isinstance(fault.trigger, Trigger), f"{fault.trigger!r} must be a trigger"
        length, each = (count, "sensor") if fault.signal == READINGS else (1, fault.part)
        assert fault.signal == READINGS or fault.part in parts, (
            f"the part {fault.part!r} must be among the parts of the failure model, {parts}"
        )
        assert fault.onset.shape == (length,), (
            f"the onset must have shape ({length},), one time a {each}, not {fault.onset.shape}"
        )
        assert fault.onset.dtype == np.float64, f"the onset must be float64: {fault.onset!r}"
        assert (fault.onset >= 0).all(), f"times must be at least 0 or infinite: {fault.onset}"


def check_case(case: Case, count: int) -> None:
    """Require valid sensors of a robot with ``count`` sensors, and a time for each."""
    assert all(0 <= sensor < count for sensor in case.sensors), (
        f"{case} must have sensors from 0 to {count - 1}"
    )
    assert len(case.times_s) == len(case.sensors), f"{case} must have a time for each sensor"
    assert all(0 <= time < np.inf for time in case.times_s), f"times of {case} must be finite"


class FailureSuite(PartSuite):
    """Conformance tests for a failure model."""

    part: Failure
    protocol = Failure
    counts = range(7)
    """The numbers of sensors of the robots whose failures are drawn."""

    def use(self, part: Any, seed: int) -> Iterator[Any]:
        """Draw the faults of some missions of robots with more and more sensors."""
        for count in self.counts:
            for draw in range(DRAWS):
                channels = self.lend(place_sensors(count))
                yield part.draw(channels, generator(f"{seed} {draw}", "failure"))

    def test_faults_cover_all_sensors(self) -> None:
        """Each fault has a filter and a time for each sensor, or for its part; infinity: never."""
        for count in self.counts:
            for draw in range(DRAWS):
                rng = generator(f"{draw}", "failure")
                check_faults(self.part.draw(place_sensors(count), rng), count, self.part.parts)


class SystematicFailureSuite(FailureSuite):
    """Conformance tests for a failure model whose cases can be counted."""

    part: SystematicFailure
    protocol = SystematicFailure

    def use(self, part: SystematicFailure, seed: int) -> Iterator[Any]:
        """State some cases, too."""
        yield from super().use(part, seed)
        for count in self.counts:
            for number in range(min(part.count_cases(count), TRIALS)):
                yield part.state_case(count, number)

    def test_cases_are_different_and_of_the_robots_sensors(self) -> None:
        """No two numbers have the same case, and all sensors of cases exist."""
        for count in self.counts:
            cases = self.part.count_cases(count)
            assert cases >= 1, f"a robot with {count} sensors must have a case"
            stated = [self.part.state_case(count, number) for number in range(min(cases, 200))]
            assert len(set(stated)) == len(stated), f"two cases of {count} sensors are equal"
            for case in stated:
                check_case(case, count)


class AdaptiveFailureSuite(FailureSuite):
    """Conformance tests for a failure model that adapts its cases to the designs of a run."""

    part: AdaptiveFailure
    protocol = AdaptiveFailure

    def use(self, part: AdaptiveFailure, seed: int) -> Iterator[Any]:
        """Play some generations against scores that are drawn."""
        yield from super().use(part, seed)
        for count in self.counts:
            adversary = part.start(count, TRIALS, generator(f"{seed}", "adversary"))
            luck = generator(f"{seed}", "scores")
            for _ in range(GENERATIONS):
                yield adversary.list_cases()
                # Designs may have met only some of the cases.
                met = {i: int(luck.random() * (TRIALS + 1)) for i in range(3)}
                scores = {
                    i: {int(place): float(luck.random()) for place in luck.permutation(TRIALS)[:n]}
                    for i, n in met.items()
                }
                adversary.tell(self.lend(scores))

    def test_each_trial_has_a_case_of_the_robots_sensors(self) -> None:
        """Whatever the scores are, cases name sensors that exist, and times."""
        for count in self.counts:
            adversary = self.part.start(count, TRIALS, generator("", "adversary"))
            luck = generator("", "scores")
            for _ in range(GENERATIONS):
                cases = adversary.list_cases()
                assert len(cases) == TRIALS, f"{TRIALS} trials must have as many cases"
                for case in cases:
                    check_case(case, count)
                adversary.tell({1: dict(enumerate(luck.random(TRIALS).tolist())), 2: {}})
