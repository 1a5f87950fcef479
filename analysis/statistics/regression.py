"""Changes between two versions of a software stack, from missions on the same random draws."""

import math
from collections.abc import Hashable, Iterator, Mapping, Sequence
from statistics import NormalDist
from typing import Any

import numpy as np
import pandas as pd
import scipy

from evoros.base.arrays import Array
from evoros.requirement.bets import bound, decide

from ..tables.pairs import BETTER, COMPLETED, QUANTITIES, SLIGHT, TIME, WORSE
from .small_samples import CELLS, LEVEL, RESAMPLES, SEED, Interval, holm, mean_interval

MIN_CHANGED = 20  # minimum number of differing pairs for the interval of an unbounded mean
_HALVINGS = 60


def mcnemar(gained: int, lost: int) -> float:
    """Return the two-sided p-value of McNemar's exact test for pairs gained and lost."""
    changed = gained + lost
    return float(scipy.stats.binomtest(gained, changed, 0.5).pvalue) if changed else 1.0


def sign_flips(differences: Array) -> float:
    """Return the two-sided p-value of the sign-flip test of paired differences (Fisher 1935)."""
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
    """Return the change of a share in pairs with its score interval (Tango 1998)."""
    change = (gained - lost) / pairs
    upper = _find_upper(gained, lost, pairs)
    return Interval(change, -_find_upper(lost, gained, pairs), upper)


def _find_upper(gained: int, lost: int, pairs: int) -> float:
    z = NormalDist().inv_cdf(1 - LEVEL / 2)
    low, high = (gained - lost) / pairs, 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        deviation = gained - lost - pairs * middle
        variance = pairs * (2 * _fit_lost(gained, lost, pairs, middle) + middle * (1 - middle))
        low, high = (middle, high) if deviation**2 <= z**2 * variance else (low, middle)
    return low


def _fit_lost(gained: int, lost: int, pairs: int, change: float) -> float:
    """Return the maximum-likelihood share of lost pairs, given the change of the share."""
    b = (2 * pairs - gained + lost) * change - gained - lost
    c = -lost * change * (1 - change)
    return (math.sqrt(b * b - 8 * pairs * c) - b) / (4 * pairs)


def bounded_change_interval(differences: Array) -> Interval:
    """Return the mean of differences from -1 to 1 with its betting interval.

    The differences must be independent, and their order must not depend on their values. The bounds
    hold even if pairs rarely differ, in which case a bootstrap underestimates the variation.
    """
    low, high = (2 * end - 1 for end in bound((1 + differences) / 2, 1 - LEVEL / 2))
    return Interval(float(differences.mean()), low, high)


def change_interval(differences: Array) -> Interval:
    """Return a mean difference, with a bootstrap interval if enough differences are nonzero."""
    changed = int(np.count_nonzero(differences))
    interval = mean_interval(np.sort(differences))
    # Fewer differences do not represent the tails of the distribution.
    return interval if changed >= MIN_CHANGED else Interval(interval.value)


BOUNDED = ("completed", "progress")  # quantities from 0 to 1, whose changes are bounded
ALL_WORLDS, UNCHANGED = "", "unchanged"
MINUS = "\N{MINUS SIGN}"
COUNTS = ("missions", "trials", "better", "worse", "both", "neither")
COLUMNS = (
    *("design", "world", "quantity", *COUNTS, "mean_a", "mean_b"),
    *("difference", "low", "high", "p", "p_holm", "result"),
)
MARGIN_COLUMNS = (
    *("design", "world", "quantity", "margin", "result", "trials", "difference"),
    *("low", "high", "confidence"),
)


def compare_missions(pairs: pd.DataFrame, quantities: Sequence[str]) -> pd.DataFrame:
    """Test the changes of each design: one row per quantity and world, and one over all worlds.

    ``pairs`` comes from ``pair_missions``. Holm's method adjusts p-values over all rows with
    changed missions. ``result`` is ``unchanged`` without such missions, ``worse`` or ``better`` for
    a significant change, otherwise empty. Completion times within ``SLIGHT`` are equal.
    """
    rows = [
        {"design": design, "world": world, "quantity": quantity, **numbers}
        for design, world, missions in _list_groups(pairs)
        for quantity in quantities
        if (numbers := _compare(missions, quantity))
    ]
    table = pd.DataFrame(rows, columns=[name for name in COLUMNS if name not in COLUMNS[-2:]])
    table["p_holm"] = 1.0
    changed = table["better"] + table["worse"] > 0
    table.loc[changed, "p_holm"] = holm(table.loc[changed, "p"].to_numpy(float))
    signs = table["quantity"].map(QUANTITIES) * table["difference"]
    slight = table["difference"].abs() <= SLIGHT * table["mean_a"] * (table["quantity"] == TIME)
    significant = (table["p_holm"] < LEVEL) & ~slight
    result = np.where(significant, np.where(signs > 0, BETTER, WORSE), "")
    return table.assign(result=np.where(changed, result, UNCHANGED))


def _list_groups(pairs: pd.DataFrame) -> Iterator[tuple[str, str, pd.DataFrame]]:
    for design, of_design in pairs.groupby("design", sort=True):
        yield str(design), ALL_WORLDS, of_design
        if of_design["world"].nunique() > 1:
            for world, missions in of_design.groupby("world", sort=True):
                yield str(design), str(world), missions


def _compare(missions: pd.DataFrame, quantity: str) -> dict[str, Any]:
    """Compare the trial means of a quantity, because worlds of a trial share random draws."""
    known = missions.set_index("trial")[[f"{quantity}_a", f"{quantity}_b"]].dropna()
    if known.empty:
        return {}
    a, b = known.to_numpy(float).T
    gains = QUANTITIES[quantity] * (b - a)
    gains[np.abs(gains) <= SLIGHT * a * (quantity == TIME)] = 0.0
    done = quantity == COMPLETED
    mean_a, mean_b = known.groupby(level=0).mean().to_numpy(float).T
    change = _estimate_change(mean_b - mean_a, quantity, len(known))
    return {
        "missions": len(known),
        "trials": len(mean_a),
        "better": int((gains > 0).sum()),
        "worse": int((gains < 0).sum()),
        "both": int((a * b).sum()) if done else np.nan,
        "neither": int(((1 - a) * (1 - b)).sum()) if done else np.nan,
        **{"mean_a": mean_a.mean(), "mean_b": mean_b.mean()},
        **{"difference": change.value, "low": change.low, "high": change.high},
        "p": sign_flips(mean_b - mean_a),
    }


def _estimate_change(differences: Array, quantity: str, missions: int) -> Interval:
    if quantity == COMPLETED and len(differences) == missions:
        gained, lost = (int((sign * differences > 0).sum()) for sign in (1, -1))
        return share_change_interval(gained, lost, missions)
    return (bounded_change_interval if quantity in BOUNDED else change_interval)(differences)


def format_change(row: Mapping[Hashable, Any]) -> str:
    """Format the mean change of a row with its interval, with suitable decimals."""
    change = Interval(row["difference"], row["low"], row["high"])
    size = max(map(abs, (change.value, *(x for x in (change.low, change.high) if x == x))))
    return change.write(f"+.{3 if size < 1 else 2 if size < 100 else 0}f").replace("-", MINUS)


def judge_margins(
    pairs: pd.DataFrame, margins: Mapping[str, float], confidence: float
) -> pd.DataFrame:
    """Test in sequence, by design and world, whether each mean falls by less than its margin."""
    rows = [
        [design, world, name, margin, *_judge(missions, name, margin, confidence)]
        for (design, world), missions in pairs.sort_values("trial").groupby(["design", "world"])
        for name, margin in margins.items()
    ]
    table = pd.DataFrame(rows, columns=list(MARGIN_COLUMNS[:-1]))
    return table.assign(confidence=confidence)


def _judge(
    missions: pd.DataFrame, quantity: str, margin: float, confidence: float
) -> tuple[str, int, float, float, float]:
    changes = (missions[f"{quantity}_b"] - missions[f"{quantity}_a"]).to_numpy(float)
    values = (1 + changes) / 2  # scaled to 0..1
    result, count = decide(values, (1 - margin) / 2, confidence)
    low, high = (2 * limit - 1 for limit in bound(values[:count], confidence))
    return result, count, float(changes[:count].mean()), low, high
