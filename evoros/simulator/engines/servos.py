"""Servos that lag."""

from evoros.base import elementary


def lag_gain(step: float, lag: float) -> float:
    """Return the share of an error that a first-order lag [s] makes up in a step [s]."""
    return -elementary.expm1(-step / lag) if lag > 0.0 else 1.0
