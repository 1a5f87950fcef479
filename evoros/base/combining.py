"""Rules that combine the trial scores of a design into a fitness."""

import math
from collections.abc import Sequence
from typing import Protocol


class Combine(Protocol):
    """Computes the fitness of a design from the scores of one or more trials.

    With ``trials``, the result is the expected fitness of that number of scores drawn at random
    without replacement (of all scores if there are fewer), which makes designs with different
    numbers of trials comparable.
    """

    def __call__(self, scores: Sequence[float], trials: int | None = None) -> float:
        """Return the fitness."""


def mean(scores: Sequence[float], trials: int | None = None) -> float:
    """Return the mean of the scores, which does not depend on ``trials``."""
    return sum(scores) / len(scores)


def mean_lowest(scores: Sequence[float], share: float, trials: int | None = None) -> float:
    """Return the mean of the lowest ``share`` of the scores, and at least of one score.

    The share is exact: the last score has a fractional weight (conditional value at risk:
    Rockafellar and Uryasev, Conditional value-at-risk for general loss distributions, Journal of
    Banking & Finance 26, 2002, proposition 8). With ``trials``, the result is the average over all
    subsets of that size.
    """
    ordered = sorted(scores)
    drawn = min(trials or len(ordered), len(ordered))
    part = max(1.0, share * drawn)
    lowest = [_expect_rank(ordered, drawn, rank) for rank in range(math.ceil(part))]
    weights = [min(1.0, part - rank) for rank in range(len(lowest))]
    return math.fsum(w * score for w, score in zip(weights, lowest, strict=True)) / part


def _expect_rank(ordered: Sequence[float], drawn: int, rank: int) -> float:
    """Return the expected score at ``rank`` in a sample of ``drawn`` out of ``ordered`` scores."""
    size = len(ordered)
    if drawn == size:
        return ordered[rank]
    choices = math.comb(size, drawn)
    return math.fsum(
        math.comb(i, rank) * math.comb(size - 1 - i, drawn - 1 - rank) / choices * score
        for i, score in enumerate(ordered)
    )
