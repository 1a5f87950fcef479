"""The time window in which a failure happens: ``earliest_s`` to ``latest_s``."""

from typing import Protocol

from evoros.base.checks import invalid


class Timed(Protocol):
    """A failure with a time window."""

    @property
    def earliest_s(self) -> float:
        """The earliest time [s]."""
        ...

    @property
    def latest_s(self) -> float:
        """The latest time [s]."""
        ...


def check_window(failure: Timed) -> None:
    """For ``__post_init__`` of a failure.

    Raises:
        InputError: the latest time is before the earliest.
    """
    if failure.earliest_s > failure.latest_s:
        rule = f"must be at most latest_s ({failure.latest_s})"
        raise invalid(failure, "earliest_s", failure.earliest_s, rule)


def time_at(failure: Timed, share: float) -> float:
    """The time [s] at a share of the window, 0..1."""
    return failure.earliest_s + (failure.latest_s - failure.earliest_s) * share
