"""Values that are either one number or an interval [low, high]."""

from typing import Any

from evoros.base.checks import Rule, is_number


def _is_interval(value: object) -> bool:
    pair = isinstance(value, list | tuple) and len(value) == 2 and all(map(is_number, value))
    return is_number(value) or (pair and value[0] <= value[1])  # type: ignore[index]


INTERVAL = Rule("a number, or [low, high] with low at most high", _is_interval)


def bounds(interval: Any) -> tuple[float, float]:
    """Lowest and highest value of an interval as configured: a number, or [low, high]."""
    low, high = (interval, interval) if is_number(interval) else interval
    return float(low), float(high)


def scale(gene: float, low: float, high: float) -> float:
    """The value at ``gene`` (0..1) between ``low`` and ``high``, which rounding never leaves."""
    return min(max(low + gene * (high - low), low), high)


def pick_index(gene: float, count: int) -> int:
    """The index, 0..count-1, at ``gene`` (0..1); each has an equal share, and 1 is the last."""
    return min(int(gene * count), count - 1)
