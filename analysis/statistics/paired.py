"""Tests and intervals of paired values: the same draws under two conditions.

Every function is deterministic, and its result does not depend on the order of the pairs.
"""

import math
from statistics import NormalDist

import numpy as np
import scipy

from evoros.base.arrays import Array

from .small_samples import CELLS, LEVEL, RESAMPLES, SEED, Interval, mean_interval

_HALVINGS = 60


def mcnemar(gained: int, lost: int) -> float:
    """Return the two-sided p of McNemar's exact test of two paired shares.

    ``gained`` counts the pairs in which the second alone is true, ``lost`` those in which the first
    alone is. Pairs that agree say nothing. McNemar (1947), Psychometrika 12, 153-157.
    """
    changed = gained + lost
    return float(scipy.stats.binomtest(gained, changed, 0.5).pvalue) if changed else 1.0


def sign_flips(differences: Array) -> float:
    """Return the two-sided p of the permutation test of paired differences (Fisher 1935).

    If nothing differs within pairs, each difference has either sign with the same chance. The p
    is exact for differences of one size, when it is McNemar's, and for few; otherwise the signs are
    drawn.
    """
    changed = np.sort(differences[differences != 0])
    if not changed.size:
        return 1.0
    sizes = np.abs(changed)
    if math.isclose(sizes.min(), sizes.max()):
        return mcnemar(int((changed > 0).sum()), int((changed < 0).sum()))
    test = scipy.stats.permutation_test(
        (changed,),
        np.mean,
        permutation_type="samples",
        vectorized=True,
        n_resamples=RESAMPLES,
        batch=max(1, CELLS // changed.size),
        rng=np.random.default_rng(SEED),
    )
    return float(test.pvalue)


def share_change_interval(gained: int, lost: int, pairs: int) -> Interval:
    """Return the change of a paired share, and its score interval.

    Unlike a bootstrap's, the interval of shares that do not change has a width. Tango (1998),
    Stat. Med. 17, 891-908.
    """
    change = (gained - lost) / pairs
    upper = _find_upper(gained, lost, pairs)
    return Interval(change, -_find_upper(lost, gained, pairs), upper)


def _find_upper(gained: int, lost: int, pairs: int) -> float:
    """Return the greatest change that the score test does not reject."""
    z = NormalDist().inv_cdf(1 - LEVEL / 2)
    low, high = (gained - lost) / pairs, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        deviation = gained - lost - pairs * middle
        variance = pairs * (2 * _fit_lost(gained, lost, pairs, middle) + middle * (1 - middle))
        low, high = (middle, high) if deviation**2 <= z**2 * variance else (low, middle)
    return low


def _fit_lost(gained: int, lost: int, pairs: int, change: float) -> float:
    """Return the most likely share of lost pairs if the share changes by ``change``."""
    b = (2 * pairs - gained + lost) * change - gained - lost
    c = -lost * change * (1 - change)
    return (math.sqrt(b * b - 8 * pairs * c) - b) / (4 * pairs)


def change_interval(differences: Array, of_share: bool) -> Interval:
    """Return the mean of paired differences and its interval: of a share, the score interval."""
    if not of_share:
        return mean_interval(np.sort(differences))
    gained, lost = (int((sign * differences > 0).sum()) for sign in (1, -1))
    return share_change_interval(gained, lost, len(differences))
