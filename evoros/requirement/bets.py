"""Shows by bets that the mean of bounded values exceeds a limit, after any number of values.

A gambler bets that the next value exceeds the limit, at odds that are fair if the mean is the
limit. If the mean is at most the limit, the capital ever reaches 1 / (1 - confidence) with at most
the chance 1 - confidence (Ville's inequality). So one may look after each value, and stop at any
time. Source: Waudby-Smith and Ramdas, Estimating means of bounded random variables by betting,
Journal of the Royal Statistical Society B 86, 2024, equation 20 and proposition 2. The capital here
is shared among constant bets, which suit means at different distances from the limit.
"""

import numpy as np

from evoros.base.arrays import Array
from evoros.requirement.verdict import MET, UNDECIDED, VIOLATED

DIGITS = 6
"""Digits of bounds, so that they are the same on every processor."""
BETS = ((1.0, 0.3), (0.9, 0.15), (0.7, 0.15), (0.5, 0.15), (0.3, 0.1), (0.15, 0.1), (0.05, 0.05))
"""Shares of the largest bet that a gambler can pay, and shares of the capital for each of them."""
_HALVINGS = 30


def count_to_proof(values: Array, limit: float, confidence: float) -> int:
    """Return after how many of the values it is shown that their mean exceeds the limit.

    ``values`` (n,) are independent and from 0 to 1, and ``limit`` is between 0 and 1. The result is
    0 if it is not shown. It is wrong with at most the chance 1 - confidence, however large n is.
    """
    with np.errstate(all="ignore"):  # a capital without end is a proof
        capital = sum(
            part * np.multiply.accumulate(1 + share * (values / limit - 1)) for share, part in BETS
        )
    proofs = np.flatnonzero(np.asarray(capital) >= 1 / (1 - confidence))
    return 1 + int(proofs[0]) if len(proofs) else 0


def decide(values: Array, limit: float, confidence: float) -> tuple[str, int]:
    """Return whether the mean of the values is shown to exceed a limit, and after how many.

    The result is MET, VIOLATED if the values show the contrary, or UNDECIDED by all of them.
    """
    proofs = {
        MET: count_to_proof(values, limit, confidence),
        VIOLATED: count_to_proof(1 - values, 1 - limit, confidence),
    }
    decided = {result: count for result, count in proofs.items() if count}
    result = min(decided, key=decided.__getitem__, default=UNDECIDED)
    return result, decided.get(result, len(values))


def bound(values: Array, confidence: float) -> tuple[float, float]:
    """Return a lower and an upper bound of the mean, each of which holds with the confidence."""
    return bound_from_below(values, confidence), 1 - bound_from_below(1 - values, confidence)


def bound_from_below(values: Array, confidence: float) -> float:
    """Return the greatest limit that the mean of the values is shown to exceed; at least 0."""
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if count_to_proof(values, middle, confidence) else (low, middle)
    return round(low, DIGITS)
