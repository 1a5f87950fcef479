"""The surroundings that no part may depend on: the clock, and the global random generators."""

import datetime
import random
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

LATER_S = 123_456_789  # some years
CLOCKS = "time", "monotonic", "perf_counter", "process_time", "thread_time"


@contextmanager
def later() -> Iterator[None]:
    """Set the clocks of Python forward, in every module that has imported their functions."""
    changed: dict[Any, Any] = {
        getattr(time, name): _forward(getattr(time, name), LATER_S) for name in CLOCKS
    }
    for name in (f"{clock}_ns" for clock in CLOCKS):
        changed[getattr(time, name)] = _forward(getattr(time, name), LATER_S * 10**9)
    changed |= {datetime.datetime: _LaterDatetime, datetime.date: _LaterDate}
    before = list(_find(changed))
    for namespace, name, value in before:
        namespace[name] = changed[value]
    try:
        yield
    finally:
        for namespace, name, value in before:
            namespace[name] = value


def _find(values: dict[Any, Any]) -> Iterator[tuple[dict[str, Any], str, Any]]:
    """Yield the places in modules that hold one of these values."""
    by_id = {id(value): value for value in values}
    for module in list(sys.modules.values()):
        namespace = getattr(module, "__dict__", None)
        if namespace is None or namespace is globals():
            continue
        for name, value in list(namespace.items()):
            if id(value) in by_id:
                yield namespace, name, value


def _forward(clock: Callable[[], Any], by: Any) -> Callable[[], Any]:
    return lambda: clock() + by


class _LaterDatetime(datetime.datetime):
    @classmethod
    def now(cls, tz: datetime.tzinfo | None = None) -> Any:
        """Return the time, set forward."""
        return datetime.datetime.fromtimestamp(time.time(), tz)

    @classmethod
    def utcnow(cls) -> Any:
        """Return the time in UTC, set forward."""
        return cls.now(datetime.UTC).replace(tzinfo=None)

    @classmethod
    def today(cls) -> Any:
        """Return the time, set forward."""
        return cls.now()


class _LaterDate(datetime.date):
    @classmethod
    def today(cls) -> Any:
        """Return the date, set forward."""
        return _LaterDatetime.now().date()


@contextmanager
def global_seed(seed: int) -> Iterator[Callable[[], bool]]:
    """Seed the global generators of Python and numpy; yields whether they are still untouched."""
    python, numpy = random.getstate(), np.random.get_state()
    random.seed(seed)
    np.random.seed(seed)
    fresh = _global_state()
    try:
        yield lambda: _global_state() == fresh
    finally:
        random.setstate(python)
        np.random.set_state(numpy)


def _global_state() -> Any:
    return random.getstate(), repr(np.random.get_state(legacy=False))
