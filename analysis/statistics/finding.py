"""Findings on claims: a value, its interval, and a verdict by a rule."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .small_samples import NOTHING, Interval

SUPPORTED, NOT_SUPPORTED, UNKNOWN = "supported", "not supported", "inconclusive"
BUILT_IN = "built in"  # true by configuration alone, as random designs show
SHARE, DEGREES, NUMBER = "share", "deg", ""  # units of measured values
MIN_REPLICATES = 6  # minimum sample size for which the range covers the median in 95 % of samples
SIZE = 0.2  # difference below which shares, or spreads relative to random designs, are equal


@dataclass(frozen=True)
class Finding:
    """A row in the table of claims."""

    claim: str  # text of the claim
    measure: str  # the measured quantity
    unit: str
    value: float  # NaN if not measurable
    low: float  # lower bound of the 95 % interval; NaN if there is no interval
    high: float
    n: int  # number of replicates
    reference: float  # bound in the rule
    random: float  # value of random designs; NaN if unknown
    p: float  # p-value of the rule's test; NaN if there is no test
    verdict: str
    why: str


class Against(NamedTuple):
    """The values with which a rule compares; NaN if missing."""

    reference: float = np.nan  # bound in the rule
    random: float = np.nan  # value of random designs
    p: float = np.nan  # p-value of the rule's test


NOTHING_ELSE = Against()


@dataclass(frozen=True)
class Claim:
    """A claim, and the quantity measured to test it."""

    text: str
    measure: str
    unit: str = SHARE

    def conclude(
        self, measured: Interval, n: int, judged: tuple[str, str], against: Against = NOTHING_ELSE
    ) -> Finding:
        """Return the finding on n replicates; ``judged`` holds the verdict and its reason."""
        verdict, why = judged
        if not np.isnan(measured.value) and n < MIN_REPLICATES:
            why += f"; {n} replicate{'' if n == 1 else 's'}"
        measures = (self.text, self.measure, self.unit, measured.value, measured.low)
        return Finding(*measures, measured.high, n, *against, verdict, why)

    def lack(self, data: str) -> Finding:
        """Return an undecided finding that names the missing data."""
        return self.conclude(NOTHING, 0, (UNKNOWN, f"needs {data}"))


def judge_above(measured: Interval, bound: float) -> str:
    """Return SUPPORTED if the interval is above the bound, NOT_SUPPORTED if below."""
    if measured.low > bound:
        return SUPPORTED
    return NOT_SUPPORTED if measured.high < bound else UNKNOWN


def judge_within(measured: Interval, low: float, high: float) -> str:
    """Return SUPPORTED if the interval is within the bounds, NOT_SUPPORTED if outside."""
    if low <= measured.low and measured.high <= high:
        return SUPPORTED
    return NOT_SUPPORTED if measured.high < low or measured.low > high else UNKNOWN


def judge_more(difference: Interval) -> str:
    """Return SUPPORTED if the interval is above 0, NOT_SUPPORTED if below ``SIZE``."""
    return SUPPORTED if difference.low > 0 else judge_above(difference, SIZE)


def require_beyond_random(
    verdict: str, why: str, beyond: bool, difference: Interval = NOTHING
) -> tuple[str, str]:
    """Withhold support if random designs fulfil the claim equally well; add this to the reason.

    The verdict is BUILT_IN if the interval of the difference is within ``SIZE`` of 0.
    """
    if verdict != SUPPORTED or beyond:
        return verdict, why
    equal = difference.low > -SIZE and difference.high < SIZE
    return BUILT_IN if equal else UNKNOWN, f"{why}; not distinguishable from random designs"


def require_replicates(verdict: str, *counts: int) -> str:
    """Withhold the verdict if a resampled interval is based on fewer than ``MIN_REPLICATES``."""
    return verdict if min(counts) >= MIN_REPLICATES else UNKNOWN
