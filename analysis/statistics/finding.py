"""A finding on a claim: number, interval, and a verdict by a rule."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .small_samples import NOTHING, Interval

SUPPORTED, NOT_SUPPORTED, UNKNOWN = "supported", "not supported", "cannot be said"
BUILT_IN = "built in"
"""The verdict on a claim that the configuration itself makes true, as random designs may show."""
SHARE, DEGREES, NUMBER = "share", "deg", ""
"""Units of the measured values."""
MIN_REPLICATES = 6
"""With fewer, even the whole range of a sample covers the median in less than 95 % of samples."""
SIZE = 0.2
"""Shares, and spreads relative to random designs, count as equal if they differ by less."""


@dataclass(frozen=True)
class Finding:
    """A row of the table of claims."""

    claim: str  # text of the claim
    measure: str  # the measured quantity
    unit: str
    value: float  # NaN: could not be measured
    low: float  # bounds of the 95 % interval; NaN: there is none
    high: float
    n: int  # number of replicates
    reference: float  # a bound of the rule
    random: float  # value of random designs; NaN: they have none, or it is not known
    p: float  # of the test in the rule; NaN: there is none
    verdict: str
    why: str


class Against(NamedTuple):
    """The values with which a rule compares; NaN: there is none."""

    reference: float = np.nan  # a bound of the rule
    random: float = np.nan  # the value of random designs
    p: float = np.nan  # of the test in the rule


NOTHING_ELSE = Against()


@dataclass(frozen=True)
class Claim:
    """A claim and the quantity that is measured for it."""

    text: str
    measure: str
    unit: str = SHARE

    def conclude(
        self, measured: Interval, n: int, judged: tuple[str, str], against: Against = NOTHING_ELSE
    ) -> Finding:
        """Return the finding, of n replicates; ``judged`` are the verdict and its reason."""
        verdict, why = judged
        if not np.isnan(measured.value) and n < MIN_REPLICATES:
            why += f"; {n} replicate{'' if n == 1 else 's'}"
        measures = (self.text, self.measure, self.unit, measured.value, measured.low)
        return Finding(*measures, measured.high, n, *against, verdict, why)

    def lack(self, data: str) -> Finding:
        """Return the finding without a value that names the missing data."""
        return self.conclude(NOTHING, 0, (UNKNOWN, f"needs {data}"))


def judge_above(measured: Interval, bound: float) -> str:
    """Support a value whose interval lies above the bound, reject one whose interval is below."""
    if measured.low > bound:
        return SUPPORTED
    return NOT_SUPPORTED if measured.high < bound else UNKNOWN


def judge_within(measured: Interval, low: float, high: float) -> str:
    """Support a value whose interval lies within the bounds, reject one that lies outside."""
    if low <= measured.low and measured.high <= high:
        return SUPPORTED
    return NOT_SUPPORTED if measured.high < low or measured.low > high else UNKNOWN


def judge_more(difference: Interval) -> str:
    """Support a difference above 0 for sure, reject one below ``SIZE`` for sure."""
    return SUPPORTED if difference.low > 0 else judge_above(difference, SIZE)


def require_beyond_random(
    verdict: str, why: str, beyond: bool, difference: Interval = NOTHING
) -> tuple[str, str]:
    """Withhold support if random designs meet the claim as well, and say so.

    The claim is built in if the difference from them is below ``SIZE`` for sure.
    """
    if verdict != SUPPORTED or beyond:
        return verdict, why
    equal = difference.low > -SIZE and difference.high < SIZE
    return BUILT_IN if equal else UNKNOWN, f"{why}; not told from random designs"


def require_replicates(verdict: str, *counts: int) -> str:
    """Withhold the verdict of a resampled interval if a count is below ``MIN_REPLICATES``."""
    return verdict if min(counts) >= MIN_REPLICATES else UNKNOWN
