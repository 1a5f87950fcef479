"""The rows of the table of coverage: data that are drawn, and what counts."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.random import Generator

MANY, SLOW, FEW = 3000, 333, 100
"""Repetitions of fast, slow and very slow subjects."""
Trial = Callable[[Generator], bool | None]
"""Draws data once: whether an interval covers, or a test rejects; None: it gives no result."""


@dataclass(frozen=True)
class Row:
    """The trials with data of one size, by column."""

    data: str
    trials: Mapping[str, Trial]


@dataclass(frozen=True)
class Subject:
    """An interval, which should cover, or a test of what is not so, which should not reject."""

    name: str
    printed_by: str  # commands and files
    functions: Sequence[Callable[..., Any]]  # of evoros
    rows: Sequence[Row]
    is_interval: bool = True
    repetitions: int = 1000  # unless others are asked for

    @property
    def nominal(self) -> float:
        """The share that an interval should cover at least, and a test reject at most."""
        return 0.95 if self.is_interval else 0.05

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of its first row, which has all."""
        return tuple(self.rows[0].trials)


def postpone(make: Callable[..., Trial], *arguments: Any) -> Trial:
    """Return a trial that is made, with the true value, at its first draw."""
    make_once = cache(make)
    return lambda rng: make_once(*arguments)(rng)


def within(low: float, truth: float, high: float) -> bool | None:
    """Whether an interval covers; None if there is none."""
    if np.isnan(low) or np.isnan(high):
        return None
    slack = 1e-6  # bounds are rounded
    return bool(low - slack <= truth <= high + slack)
