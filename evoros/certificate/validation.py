"""The precision with which a champion is validated, and the intervals of its trials."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import fmean, stdev
from typing import Annotated

import scipy

from evoros.base.checks import COUNT, POSITIVE, WHOLE, Rule, checked, instance_of, is_number
from evoros.base.combining import Combine, mean
from evoros.base.errors import InputError
from evoros.base.rng import generator

DIGITS = 6
"""Digits of the results, so that they are the same on every processor."""
PRECISION = Rule("null, or a number greater than 0", lambda v: v is None or POSITIVE.holds(v))
CONFIDENCE = Rule("a number from 0.5 to 0.999", lambda v: is_number(v) and 0.5 <= v <= 0.999)

RESAMPLES = 2000
MIN_DECISIVE = 10
"""Trials on which the fitness must depend; with fewer, intervals are much too narrow."""

Bounds = tuple[float, float]


@dataclass(frozen=True)
@checked
class Validation:
    """The trials on fresh draws by which a champion's fitness and success are stated.

    Without a ``precision`` they are the validation trials of the optimizer. With one, the sampling
    has two stages (Stein, A two-sample test for a linear hypothesis whose power is independent of
    the variance, Annals of Mathematical Statistics 16, 1945): the standard deviation s of the
    ``first`` trials sets the number of all, the smallest n with t s / sqrt(n) <= precision. The
    interval is the mean of all n +- t s / sqrt(n), with s and the degrees of freedom of the first
    stage. It holds its confidence although n depends on the scores, if scores are normal.
    """

    precision: Annotated[float | None, PRECISION] = None  # half-width of fitness
    first: Annotated[int, COUNT] = 10  # trials of the first stage, at least
    max_trials: Annotated[int, COUNT] = 200
    confidence: Annotated[float, CONFIDENCE] = 0.95  # of each interval
    rivals: Annotated[int, WHOLE] = 0  # other designs that are validated beside the champion

    def __post_init__(self) -> None:
        if self.precision is not None and not 2 <= self.first <= self.max_trials:
            raise InputError(
                f"validation.first: must be at least 2 and at most validation.max_trials "
                f"({self.max_trials}), not {self.first}; correct it"
            )

    def count_first(self, trials: int) -> int:
        """Return the trials of the first stage; each best of a generation gets ``trials``."""
        return trials if self.precision is None else max(trials, self.first)

    def count_all(self, first: Sequence[float]) -> int:
        """Return the trials of both stages, for the scores of the first one."""
        if self.precision is None:
            return len(first)
        half_width = self.quantile(len(first)) * stdev(first) / self.precision
        wanted = math.ceil(round(half_width * half_width, DIGITS))
        return max(len(first), min(wanted, self.max_trials))

    def bound_mean(self, scores: Sequence[float], first: int) -> Bounds:
        """Return the interval of the mean, whose first stage had so many scores; NaN below two."""
        if first < 2:
            return math.nan, math.nan
        half_width = self.quantile(first) * (stdev(scores[:first]) / math.sqrt(len(scores)))
        centre = fmean(scores)
        return round(centre - half_width, DIGITS), round(centre + half_width, DIGITS)

    def bound_fitness(self, scores: Sequence[float], first: int, combine: Combine) -> Bounds:
        """Return the interval of a mean, or of another fitness by the bootstrap.

        It is NaN if the fitness depends on too few scores (``resample``).
        """
        if combine is mean:
            return self.bound_mean(scores, first)
        values = resample(scores, combine)
        if not values:
            return math.nan, math.nan
        outside = int(len(values) * (1 - self.confidence) / 2)
        return round(values[outside], DIGITS), round(values[-1 - outside], DIGITS)

    def bound_rate(self, successes: int, trials: int) -> Bounds:
        """Return the interval of a rate; see ``bound_rate``."""
        return bound_rate(successes, trials, self.confidence)

    def quantile(self, trials: int) -> float:
        """Return the two-sided quantile of Student's t for so many trials, at least 2."""
        return float(scipy.special.stdtrit(trials - 1, 0.5 + self.confidence / 2))


def bound_rate(successes: int, trials: int, confidence: float) -> Bounds:
    """Return the score interval of a rate; NaN without trials.

    Source: Wilson, Probable inference, the law of succession, and statistical inference, Journal of
    the American Statistical Association 22, 1927.
    """
    if not trials:
        return math.nan, math.nan
    z = float(scipy.special.ndtri(0.5 + confidence / 2))
    rate, scale = successes / trials, 1 + z * z / trials
    centre = (rate + z * z / (2 * trials)) / scale
    inner = rate * (1 - rate) / trials + z * z / (4 * trials * trials)
    half_width = z * math.sqrt(inner) / scale
    low, high = max(0.0, centre - half_width), min(1.0, centre + half_width)
    return round(low, DIGITS), round(high, DIGITS)


def compute_chance(
    champion: Sequence[float], rival: Sequence[float], combine: Combine = mean
) -> float:
    """Return the chance that the rival is better, by the trials that both have met; NaN below two.

    It is the posterior probability that the mean of the paired differences is positive, for normal
    differences and the prior 1 / sd: Student's t at the statistic of the paired t-test. For another
    fitness it is the share of paired resamples with a better rival (``resample``).
    """
    pairs = list(zip(champion, rival, strict=False))
    if combine is not mean:
        return round(count_better(pairs, combine), DIGITS)
    if len(pairs) < 2:
        return math.nan
    ahead = [score - of_champion for of_champion, score in pairs]
    centre, spread = fmean(ahead), stdev(ahead) / math.sqrt(len(ahead))
    if spread == 0:
        return 0.5 if centre == 0 else float(centre > 0)
    return round(float(scipy.special.stdtr(len(ahead) - 1, centre / spread)), DIGITS)


def combine_chances(chances: Sequence[float]) -> float:
    """Return the chance that any rival is better, at most; NaN if there is none to compare with.

    1 - (1 - p1) (1 - p2) ... holds for independent differences. All share the champion's scores, so
    that they are positively correlated and the chance is at most this (Slepian's inequality).
    """
    known = [chance for chance in chances if not math.isnan(chance)]
    return round(1 - math.prod(1 - chance for chance in known), DIGITS) if known else math.nan


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


A_VALIDATION = instance_of(Validation, "a validation (evoros.certificate.validation.Validation)")
