"""Computes how often and how soon bets decide whether a share of missions reaches a limit.

Prints, for shares of completed missions, the exact chances of the verdicts and the mean number of
trials, up to ``MOST``; nothing is drawn at random. Beside them is the number of trials of the
exact binomial test that decides once, at a number fixed before, with the same error and power.
"""

import numpy as np
from scipy.stats import binom

from evoros.base.arrays import Array
from evoros.requirement.bets import BETS

MOST = 2000
ERROR, POWER = 0.05, 0.95
LIMITS = {
    0.95: (1.0, 0.99, 0.98, 0.97, 0.95, 0.9),
    0.8: (1.0, 0.95, 0.9, 0.8, 0.5),
}


def main() -> None:
    """Print a row of a table in Markdown for each limit and each true share."""
    print("| limit | true share | met | violated | undecided | mean trials | fixed number |")
    print("|---|---|---|---|---|---|---|")
    for limit, shares in LIMITS.items():
        for share in shares:
            met, violated, trials = decide(share, limit)
            fixed = count_fixed(share, limit)
            chances = " | ".join(
                f"{chance:.3f}" for chance in (met, violated, abs(1 - met - violated))
            )
            print(f"| {limit} | {share} | {chances} | {trials:.0f} | {fixed or ''} |")


def decide(share: float, limit: float) -> tuple[float, float, float]:
    """Return the chances of met and violated within ``MOST`` trials, and the mean trials."""
    alive, met, violated, trials = np.array([1.0]), 0.0, 0.0, 0.0
    for count in range(1, MOST + 1):
        trials += alive.sum()
        reached = np.zeros(count + 1)
        reached[1:] += alive * share
        reached[:-1] += alive * (1 - share)
        won = np.arange(count + 1, dtype=np.float64)
        above = capital(won, count - won, limit) >= 1 / ERROR
        below = capital(count - won, won, 1 - limit) >= 1 / ERROR
        met += float(reached[above].sum())
        violated += float(reached[below].sum())
        alive = np.where(above | below, 0.0, reached)
    return met, violated, float(trials)


def capital(won: Array, lost: Array, limit: float) -> Array:
    """Return the capital after bets that were won and lost, in any order."""
    total = np.zeros(len(won))
    with np.errstate(over="ignore", invalid="ignore"):
        for bet, part in BETS:
            left = np.where(lost == 0, 1.0, (1 - bet) ** lost)
            total += part * np.exp(won * np.log1p(bet * (1 / limit - 1))) * left
    return np.nan_to_num(total, nan=np.inf)


def count_fixed(share: float, limit: float) -> int:
    """Return the trials with which a fixed test has the error and the power; 0: no number has."""
    if share == limit:
        return 0
    if share < limit:  # by symmetry
        share, limit = 1 - share, 1 - limit
    for count in range(1, 20 * MOST):
        least = int(binom.isf(ERROR, count, limit)) + 1  # successes that show it
        if binom.sf(least - 1, count, share) >= POWER:
            return count
    return 0


if __name__ == "__main__":
    main()
