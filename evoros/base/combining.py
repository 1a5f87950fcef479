"""How the scores of a design's trials become one number."""

from collections.abc import Callable, Sequence

Combine = Callable[[Sequence[float]], float]
"""From the scores of trials, at least one, to the fitness of their design."""


def mean(scores: Sequence[float]) -> float:
    """Return the mean of at least one score."""
    return sum(scores) / len(scores)
