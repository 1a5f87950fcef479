"""The checks of failure models."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from evoros.base.rng import generator
from evoros.failure.protocol import AdaptiveFailure, Failure, Fault, SystematicFailure, list_parts
from evoros.failure.trigger import Trigger
from evoros.filter.protocol import READINGS, SIGNALS, Channels, Filter
from evoros.testing.filter import HIGH_M, LOW_M
from evoros.testing.part import PartSuite
from evoros.testing.rules import PERIOD_S
from evoros.testing.values import bits

DRAWS, TRIALS, GENERATIONS = 8, 4, 6


def place_sensors(count: int) -> Channels:
    """Return the channels of so many sonars in a row, 2 cm apart."""
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


class FailureSuite(PartSuite):
    """The checks of a failure model."""

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
                check_faults(
                    self.part.draw(place_sensors(count), rng), count, list_parts(self.part)
                )


class SystematicFailureSuite(FailureSuite):
    """The checks of a failure model whose faults follow from the number of the trial."""

    part: SystematicFailure
    protocol = SystematicFailure

    def use(self, part: SystematicFailure, seed: int) -> Iterator[Any]:
        """Make the faults of some trials, too."""
        yield from super().use(part, seed)
        for count in self.counts:
            for trial in range(TRIALS):
                yield part.draw_case(self.lend(place_sensors(count)), seed + trial)

    def test_cases_cover_all_sensors_and_begin_again(self) -> None:
        """After ``count_cases`` trials come the same faults."""
        for count in self.counts:
            channels, cases = place_sensors(count), self.part.count_cases(count)
            assert cases >= 1, f"a robot with {count} sensors must have a case"
            for trial in range(min(cases, 20)):
                faults = self.part.draw_case(channels, trial)
                check_faults(faults, count, list_parts(self.part))
                again = self.part.draw_case(channels, trial + cases)
                assert bits(again) == bits(faults), f"trial {trial + cases} must be as {trial}"


class AdaptiveFailureSuite(FailureSuite):
    """The checks of a failure model that adapts its cases to the designs of a run."""

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
                # Designs may have fewer trials than there are cases.
                scores = {i: luck.random(int(luck.random() * (TRIALS + 1))) for i in range(3)}
                adversary.tell(self.lend({i: list(map(float, s)) for i, s in scores.items()}))

    def test_each_trial_has_a_case_of_the_robots_sensors(self) -> None:
        """Whatever the scores are, cases name sensors that exist, and times."""
        for count in self.counts:
            adversary = self.part.start(count, TRIALS, generator("", "adversary"))
            luck = generator("", "scores")
            for _ in range(GENERATIONS):
                cases = adversary.list_cases()
                assert len(cases) == TRIALS, f"{TRIALS} trials must have as many cases"
                for case in cases:
                    assert all(0 <= sensor < count for sensor in case.sensors), (
                        f"{case} must have sensors from 0 to {count - 1}"
                    )
                    assert len(case.times_s) == len(case.sensors)
                    assert all(0 <= time < np.inf for time in case.times_s), f"times of {case}"
                adversary.tell({1: luck.random(TRIALS).tolist(), 2: []})
