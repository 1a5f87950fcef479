"""Sequential tests, by betting, of whether the mean of bounded values exceeds a limit.

A gambler bets that the next value exceeds the limit, at odds that are fair if the mean equals the
limit. If the mean is at most the limit, the probability that the capital ever reaches 1 / (1 -
confidence) is at most 1 - confidence (Ville's inequality). The test can therefore stop after any
value. Source: Waudby-Smith and Ramdas, Estimating means of bounded random variables by betting,
Journal of the Royal Statistical Society B 86, 2024, equation 20 and proposition 2. Here, the
capital is divided among constant bets, suitable for means at different distances from the limit.
"""

import math
from bisect import bisect_left

import numpy as np

from evoros.base.arrays import Array
from evoros.base.elementary import exp, log1p
from evoros.certificate.rates import share_level
from evoros.requirement.verdict import MET, UNDECIDED, VIOLATED

DIGITS = 6  # decimal places of bounds, equal on all processors
BETS = ((1.0, 0.3), (0.9, 0.15), (0.7, 0.15), (0.5, 0.15), (0.3, 0.1), (0.15, 0.1), (0.05, 0.05))
"""Bets relative to the maximum affordable bet, and the share of the capital for each bet."""
MOST_FURTHER = 1_000_000  # estimates above this become infinite
_HALVINGS = 30


def count_to_proof(values: Array, limit: float, confidence: float) -> int:
    """Return the number of values (n,) in [0, 1] that prove a mean above the limit, or 0."""
    with np.errstate(all="ignore"):  # infinite capital is also a proof
        capital = sum(
            part * np.multiply.accumulate(1 + share * (values / limit - 1)) for share, part in BETS
        )
    proofs = np.flatnonzero(np.asarray(capital) >= 1 / (1 - confidence))
    return 1 + int(proofs[0]) if len(proofs) else 0


def decide(values: Array, limit: float, confidence: float, tests: int = 1) -> tuple[str, int]:
    """Return the result for a limit on the mean, and the number of values that decide it.

    The result is MET, VIOLATED or UNDECIDED. ``tests`` share the error rate of violations; no
    correction is needed for all of them to be met (intersection-union test).
    """
    proofs = {
        MET: count_to_proof(values, limit, confidence),
        VIOLATED: count_to_proof(1 - values, 1 - limit, share_level(confidence, tests)),
    }
    decided = {result: count for result, count in proofs.items() if count}
    result = min(decided, key=decided.__getitem__, default=UNDECIDED)
    return result, decided.get(result, len(values))


def estimate_further(values: Array, limit: float, confidence: float) -> float:
    """Estimate the number of further such values that prove a mean above the limit, or infinity."""
    kinds, counts = np.unique(values, return_counts=True)
    gains = [
        math.fsum(
            count * log1p(share * (value / limit - 1))
            for value, count in zip(kinds.tolist(), counts.tolist(), strict=True)
        )
        for share, _ in BETS
    ]

    def is_shown(further: int) -> bool:
        factor = 1 + further / len(values)
        bets = zip(BETS, gains, strict=True)
        capital = sum(part * exp(factor * gain) for (_, part), gain in bets)
        return capital >= 1 / (1 - confidence)

    if max(gains) <= 0 or not is_shown(MOST_FURTHER):
        return math.inf
    return 1 + bisect_left(range(1, MOST_FURTHER), True, key=is_shown)


def bound(values: Array, confidence: float, tests: int = 1) -> tuple[float, float]:
    """Return the bounds of the mean, the upper one corrected for the number of ``tests``."""
    above = bound_from_below(1 - values, share_level(confidence, tests))
    return bound_from_below(values, confidence), 1 - above


def bound_from_below(values: Array, confidence: float) -> float:
    """Return the maximum limit that the mean provably exceeds, or 0."""
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if count_to_proof(values, middle, confidence) else (low, middle)
    return round(low, DIGITS)
