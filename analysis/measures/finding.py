"""One of the paper's findings, measured: the number, its uncertainty, and a verdict by a rule."""

from dataclasses import dataclass

import numpy as np

from .statistics import Interval

SUPPORTED, NOT_SUPPORTED, UNKNOWN = "supported", "not supported", "cannot be said"
SHARE, DEGREES, NUMBER = "share", "deg", ""
"""Units of what is measured."""
LEAST_REPLICATES = 6
"""With fewer even the whole range of a sample covers the median in less than 95% of samples."""
NOTHING = Interval(np.nan, np.nan, np.nan)


@dataclass(frozen=True)
class Finding:
    """A row of the table of claims."""

    claim: str  # what the paper says
    measure: str  # what is measured of it
    unit: str
    value: float  # NaN: it could not be measured
    low: float  # ends of the 95 % interval; NaN: there is none
    high: float
    n: int  # replicates behind it
    reference: float  # the same of random designs, or what else the rule compares with
    p: float  # of the test in the rule; NaN: there is none
    verdict: str
    why: str


@dataclass(frozen=True)
class Claim:
    """What the paper says, and what is measured of it."""

    text: str
    measure: str
    unit: str = SHARE

    def found(
        self,
        found: Interval,
        n: int,
        verdict: str,
        why: str,
        reference: float = np.nan,
        p: float = np.nan,
    ) -> Finding:
        """With what was measured; that replicates are few is said."""
        if found.value == found.value and n < LEAST_REPLICATES:
            why += f"; {n} replicate{'' if n == 1 else 's'}"
        return Finding(
            self.text,
            self.measure,
            self.unit,
            found.value,
            found.low,
            found.high,
            n,
            reference,
            p,
            verdict,
            why,
        )

    def missing(self, what: str) -> Finding:
        """Without the data."""
        return self.found(NOTHING, 0, UNKNOWN, f"needs {what}")


def above(found: Interval, bound: float) -> str:
    """Supported where the whole interval lies above, not supported where it lies below."""
    if found.low > bound:
        return SUPPORTED
    return NOT_SUPPORTED if found.high < bound else UNKNOWN


def within(found: Interval, low: float, high: float) -> str:
    """Supported where the whole interval lies within, not supported where it lies outside."""
    if low <= found.low and found.high <= high:
        return SUPPORTED
    return NOT_SUPPORTED if found.high < low or found.low > high else UNKNOWN


def enough(verdict: str, *replicates: int) -> str:
    """The verdict of a resampled interval, as far as there are replicates to resample."""
    return verdict if min(replicates) >= LEAST_REPLICATES else UNKNOWN
