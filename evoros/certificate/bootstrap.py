"""Intervals of a fitness other than the mean over trials, by resampling the trials."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence

from evoros.base.combining import Combine
from evoros.base.rng import generator

RESAMPLES = 2000
MIN_DECISIVE = 10
"""Trials on which the fitness must depend; with fewer, intervals are much too narrow."""


def resample(scores: Sequence[float], combine: Combine) -> list[float]:
    """Return the sorted fitness of resampled trials; empty if they are too few for an interval.

    The percentile bootstrap (Efron and Tibshirani, An introduction to the bootstrap, 1993). It
    fails for extremes, such as the lowest of the trials (Bickel and Freedman, Some asymptotic
    theory for the bootstrap, Annals of Statistics 9, 1981).
    """
    if count_decisive(scores, combine) < MIN_DECISIVE:
        return []
    return sorted(combine([scores[i] for i in chosen]) for chosen in _choose(len(scores)))


def count_decisive(scores: Sequence[float], combine: Combine) -> int:
    """Count the trials without which the fitness differs from its most common value."""
    if len(scores) < 2:
        return 0
    without = Counter(combine([*scores[:i], *scores[i + 1 :]]) for i in range(len(scores)))
    return len(scores) - max(without.values())


def count_better(pairs: Sequence[tuple[float, float]], combine: Combine) -> float:
    """Return the share of resampled pairs whose second scores have the higher fitness.

    Equals count half; NaN if the trials are too few for an interval of either side.
    """
    sides = [[pair[side] for pair in pairs] for side in (0, 1)]
    if min(count_decisive(scores, combine) for scores in sides) < MIN_DECISIVE:
        return math.nan
    better = 0.0
    for chosen in _choose(len(pairs)):
        first, second = (combine([scores[i] for i in chosen]) for scores in sides)
        better += 0.5 if first == second else float(second > first)
    return better / RESAMPLES


def _choose(count: int) -> Iterator[list[int]]:
    rng = generator("bootstrap", f"{count}")
    for _ in range(RESAMPLES):
        yield [int(share * count) for share in rng.random(count).tolist()]
