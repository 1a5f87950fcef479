"""What changed between two versions of a stack, by missions under the same draws."""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from evoros.requirement.bets import bound, decide

from ..tables.paired_missions import COMPLETED, QUANTITIES
from .paired import change_interval, sign_flips
from .small_samples import LEVEL, Interval, holm

BOUNDED = ("completed", "progress")
"""Quantities from 0 to 1, whose change can be shown to be small."""
ALL_WORLDS = ""
MINUS = "\N{MINUS SIGN}"
COUNTS = ("missions", "better", "worse", "both", "neither")
COLUMNS = (
    *("design", "world", "quantity", *COUNTS, "mean_a", "mean_b"),
    *("difference", "low", "high", "p", "p_holm", "result"),
)
MARGIN_COLUMNS = (
    *("design", "world", "quantity", "margin", "result", "trials", "difference"),
    *("low", "high", "confidence"),
)


def compare_missions(pairs: pd.DataFrame, quantities: Sequence[str]) -> pd.DataFrame:
    """Test the changes of each design: a row for each quantity in each world, and in all.

    ``pairs`` is from ``pair_missions``. All p are adjusted together after Holm, but for rows in
    which no mission changed: these tests, given the number of changes, cannot be significant.
    ``result`` is ``worse`` or ``better`` if a change is significant, else empty.
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
    result = np.where(signs > 0, "better", "worse")
    return table.assign(result=np.where(table["p_holm"] < LEVEL, result, ""))


def _list_groups(pairs: pd.DataFrame) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """Yield the missions of each design in all worlds and, of several, in each."""
    for design, of_design in pairs.groupby("design", sort=True):
        yield str(design), ALL_WORLDS, of_design
        if of_design["world"].nunique() > 1:
            for world, missions in of_design.groupby("world", sort=True):
                yield str(design), str(world), missions


def _compare(missions: pd.DataFrame, quantity: str) -> dict[str, Any]:
    """Compare a quantity in the missions that have it on both sides; nothing if none has."""
    known = missions[[f"{quantity}_a", f"{quantity}_b"]].dropna().to_numpy(float)
    if not len(known):
        return {}
    a, b = known.T
    gains = QUANTITIES[quantity] * (b - a)
    done = quantity == COMPLETED
    change = change_interval(b - a, done)
    return {
        "missions": len(known),
        "better": int((gains > 0).sum()),
        "worse": int((gains < 0).sum()),
        "both": int((a * b).sum()) if done else np.nan,
        "neither": int(((1 - a) * (1 - b)).sum()) if done else np.nan,
        **{"mean_a": a.mean(), "mean_b": b.mean()},
        **{"difference": change.value, "low": change.low, "high": change.high},
        "p": sign_flips(b - a),
    }


def format_change(row: Mapping[Hashable, Any]) -> str:
    """Format the mean change of a row and its interval, in as many digits as they deserve."""
    change = Interval(row["difference"], row["low"], row["high"])
    size = max(map(abs, (change.value, *(x for x in (change.low, change.high) if x == x))))
    return change.write(f"+.{3 if size < 1 else 2 if size < 100 else 0}f").replace("-", MINUS)


def judge_margins(
    pairs: pd.DataFrame, margins: Mapping[str, float], confidence: float
) -> pd.DataFrame:
    """Judge for each design and world whether the mean of a quantity falls by less than its margin.

    The trials decide as in requirements, so that a result holds however many there are.
    """
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
    """Return result, trials that decided it, mean change and its bounds."""
    changes = (missions[f"{quantity}_b"] - missions[f"{quantity}_a"]).to_numpy(float)
    values = (1 + changes) / 2  # from 0 to 1
    result, count = decide(values, (1 - margin) / 2, confidence)
    low, high = (2 * limit - 1 for limit in bound(values[:count], confidence))
    return result, count, float(changes[:count].mean()), low, high
