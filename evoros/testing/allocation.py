"""Conformance tests for allocations."""

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from evoros.allocation.protocol import Allocation
from evoros.evolution.contest import Contest
from evoros.testing.part import PartSuite

Draw = Callable[[int, int], float]  # returns the score of a design in a trial

SIZES = (1, 0, 1), (12, 0, 1), (5, 3, 2), (1, 12, 3), (12, 12, 1), (3, 1, 2)
"""Numbers of new designs, survivors and trials in each contest."""


def hold_contest(
    allocation: Allocation, trials: int, earlier: Mapping[int, list[float]], draw: Draw
) -> Contest:
    """Run trials until the allocation requests no more; evoros rejects excess trials."""
    contest = Contest(allocation, trials, earlier)
    while wanted := contest.next_round():
        for design, range_ in wanted.items():
            # designs must use the same random draws
            assert range_.start == len(contest.scores.get(design, ()))
        contest.add({i: [draw(i, k) for k in range_] for i, range_ in wanted.items()})
    return contest


def draw_noisy(seed: int, spread: float = 1.0) -> Draw:
    """Return a function that draws scores; design i has the expected score -i."""
    table = np.random.default_rng(seed).normal(size=(64, 256)) * spread
    return lambda i, k: float(table[i, k] - i)


class AllocationSuite(PartSuite):
    """Conformance tests for an allocation, in contests of up to 24 designs."""

    part: Allocation
    protocol = Allocation

    def use(self, part: Allocation, seed: int) -> Iterator[object]:
        """Hold several contests; yield the trials of each round, and the fitness."""
        for new, old, trials in SIZES:
            earlier = {i: [-float(i)] * (i < old) for i in range(old + new)}
            contest = hold_contest(part, trials, earlier, draw_noisy(seed))
            yield contest.rounds, contest.fitness()

    def test_trials_are_within_bounds(self) -> None:
        """Each new design has at least ``trials`` trials, and no design more than the maximum."""
        for seed in range(10):
            for new, old, trials in SIZES:
                earlier = {i: [-float(i)] * (i < old) for i in range(old + new)}
                scores = hold_contest(self.part, trials, earlier, draw_noisy(seed)).scores
                most = self.part.most_trials(trials)
                given = {i: len(values) for i, values in scores.items()}
                fewest = min(given.get(i, 0) for i in range(old, old + new))
                assert fewest >= trials, f"new designs must get {trials} trials or more: {given}"
                assert max(given.values()) <= most, (
                    f"no design may get more than {most} trials: {given}"
                )
