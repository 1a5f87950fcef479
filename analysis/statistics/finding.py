"""Findings on claims: a value, its interval, and the verdict by a rule."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .small_samples import NOTHING, Interval

SUPPORTED, NOT_SUPPORTED, UNKNOWN = "supported", "not supported", "inconclusive"
BUILT_IN = "built in"  # true by the configuration alone, as random designs show
SHARE, DEGREES, NUMBER = "share", "deg", ""  # units of the measured values
MIN_REPLICATES = 6  # sample size at which the full range covers the median in 95 % of samples
SIZE = 0.2  # difference below which shares, or spreads relative to random designs, count as equal


@dataclass(frozen=True)
class Finding:
    """A row of the claims table."""

    claim: str  # text of the claim
    measure: str  # the measured quantity
    unit: str
    value: float  # NaN if it cannot be measured
    low: float  # lower bound of the 95 % interval; NaN without an interval
    high: float
    n: int  # number of replicates
    reference: float  # bound used in the rule
    random: float  # value of random designs; NaN if there are none or it is unknown
    p: float  # p-value of the test in the rule; NaN without a test
    verdict: str
    why: str


class Against(NamedTuple):
    """The values with which a rule compares; missing values are NaN."""

    reference: float = np.nan  # bound used in the rule
    random: float = np.nan  # value of random designs
    p: float = np.nan  # p-value of the test in the rule


NOTHING_ELSE = Against()


@dataclass(frozen=True)
class Claim:
    """A claim, and the quantity that is measured to judge it."""

    text: str
    measure: str
    unit: str = SHARE

    def conclude(
        self, measured: Interval, n: int, judged: tuple[str, str], against: Against = NOTHING_ELSE
    ) -> Finding:
        """Return the finding from n replicates; ``judged`` is the verdict and its reason."""
        verdict, why = judged
        if not np.isnan(measured.value) and n < MIN_REPLICATES:
            why += f"; {n} replicate{'' if n == 1 else 's'}"
        measures = (self.text, self.measure, self.unit, measured.value, measured.low)
        return Finding(*measures, measured.high, n, *against, verdict, why)

    def lack(self, data: str) -> Finding:
        """Return an inconclusive finding that names the missing data."""
        return self.conclude(NOTHING, 0, (UNKNOWN, f"needs {data}"))


def judge_above(measured: Interval, bound: float) -> str:
    """Support a value if its interval is above the bound; reject it if the interval is below."""
    if measured.low > bound:
        return SUPPORTED
    return NOT_SUPPORTED if measured.high < bound else UNKNOWN


def judge_within(measured: Interval, low: float, high: float) -> str:
    """Support a value if its interval is within the bounds; reject it if entirely outside."""
    if low <= measured.low and measured.high <= high:
        return SUPPORTED
    return NOT_SUPPORTED if measured.high < low or measured.low > high else UNKNOWN


def judge_more(difference: Interval) -> str:
    """Support a difference whose interval is above 0; reject it if below ``SIZE``."""
    return SUPPORTED if difference.low > 0 else judge_above(difference, SIZE)


def require_beyond_random(
    verdict: str, why: str, beyond: bool, difference: Interval = NOTHING
) -> tuple[str, str]:
    """Withhold support if random designs meet the claim equally well, and say so in the reason.

    The claim is built in if the difference's interval is within ``SIZE`` of 0.
    """
    if verdict != SUPPORTED or beyond:
        return verdict, why
    equal = difference.low > -SIZE and difference.high < SIZE
    return BUILT_IN if equal else UNKNOWN, f"{why}; not distinguishable from random designs"


def require_replicates(verdict: str, *counts: int) -> str:
    """Withhold the verdict from a resampled interval if a count is below ``MIN_REPLICATES``."""
    return verdict if min(counts) >= MIN_REPLICATES else UNKNOWN
