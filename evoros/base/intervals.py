"""Values that are either one number or an interval [low, high]."""

from collections.abc import Sequence
from typing import Any, TypeAlias

from evoros.base.checks import Rule, is_number

Interval: TypeAlias = float | Sequence[float]
"""A number, or [low, high]."""


def _is_interval(value: object) -> bool:
    pair = isinstance(value, list | tuple) and len(value) == 2 and all(map(is_number, value))
    return is_number(value) or (pair and value[0] <= value[1])  # type: ignore[index]


INTERVAL = Rule("a number, or [low, high] with low at most high", _is_interval)


def bounds(interval: Any) -> tuple[float, float]:
    """Return the lowest and the highest value of an interval as configured."""
    low, high = (interval, interval) if is_number(interval) else interval
    return float(low), float(high)


def scale(gene: float, low: float, high: float) -> float:
    """Return the value at ``gene`` (0..1) between ``low`` and ``high``, despite rounding."""
    return min(max(low + gene * (high - low), low), high)


def pick_index(gene: float, count: int) -> int:
    """Return the index 0..count-1 at ``gene`` (0..1): equal shares, and 1 is the last index."""
    return min(int(gene * count), count - 1)
