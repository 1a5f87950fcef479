"""Rules that combine a design's trial scores into one fitness."""

import math
from collections.abc import Sequence
from typing import Protocol


class Combine(Protocol):
    """Computes a design's fitness from the scores of one or more trials.

    If ``trials`` is given, the result is the fitness expected from that number of scores drawn at
    random without replacement (all scores if there are fewer), so that designs with different
    numbers of trials are comparable."""

    def __call__(self, scores: Sequence[float], trials: int | None = None) -> float:
        """Return the fitness."""


def mean(scores: Sequence[float], trials: int | None = None) -> float:
    """Return the mean of one or more scores, which does not depend on ``trials``."""
    return sum(scores) / len(scores)


def mean_lowest(scores: Sequence[float], share: float, trials: int | None = None) -> float:
    """Return the mean of the lowest ``share`` of the scores, but of at least one score.

    The share is exact: the last score has a fractional weight (conditional value at risk:
    Rockafellar and Uryasev, Conditional value-at-risk for general loss distributions, Journal of
    Banking & Finance 26, 2002, proposition 8). With ``trials``, the result is
    averaged over all subsets of ``trials`` scores.
    """
    ordered = sorted(scores)
    drawn = min(trials or len(ordered), len(ordered))
    part = max(1.0, share * drawn)
    lowest = [_expect_rank(ordered, drawn, rank) for rank in range(math.ceil(part))]
    weights = [min(1.0, part - rank) for rank in range(len(lowest))]
    return math.fsum(w * score for w, score in zip(weights, lowest, strict=True)) / part


def _expect_rank(ordered: Sequence[float], drawn: int, rank: int) -> float:
    """Return the expected score at ``rank`` in a random sample of ``drawn`` ordered scores."""
    size = len(ordered)
    if drawn == size:
        return ordered[rank]
    choices = math.comb(size, drawn)
    return math.fsum(
        math.comb(i, rank) * math.comb(size - 1 - i, drawn - 1 - rank) / choices * score
        for i, score in enumerate(ordered)
    )
