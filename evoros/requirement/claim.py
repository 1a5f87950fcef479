"""A claim about the missions of a design, which trials decide one after another."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Annotated

import numpy as np

from evoros.base.arrays import Array
from evoros.base.checks import NAME, NUMBER, Rule, checked, is_number
from evoros.base.errors import InputError
from evoros.certificate.validation import CONFIDENCE
from evoros.measure.protocol import BOUNDS, Measure
from evoros.requirement.bets import bound, decide
from evoros.requirement.quantity import BOUNDS as NATURAL
from evoros.requirement.quantity import read_quantity
from evoros.requirement.verdict import Trial, Verdict

QUANTITY = Rule(
    "a column of missions or a measure", lambda v: isinstance(v, str | Measure), plain=True
)
SHARE = Rule("a number greater than 0 and less than 1", lambda v: is_number(v) and 0 < v < 1)

Measured = Callable[[Measure, Trial], float]
"""Computes a measure of one trial."""


@dataclass(frozen=True)
@checked
class Claim:
    """The mean of a quantity over trials, or its value in a share of missions, keeps a limit.

    With ``share``, the limit must hold in at least this share of the missions, so that a quantile
    of the quantity is required. Otherwise it is one for the mean of the quantity, each value of
    which counts as the nearest of the bounds ``within``, if it is beyond. A mission that could not
    be run has the worst value.

    Raises:
        InputError: a value out of range, or no claim that missions could show.
    """

    of: Annotated[str | Measure, QUANTITY]
    at_least: Annotated[float | None, NUMBER] = None
    at_most: Annotated[float | None, NUMBER] = None
    share: Annotated[float | None, SHARE] = None
    within: Annotated[Sequence[float] | None, BOUNDS] = None
    world: Annotated[str | None, NAME] = None  # null: the missions of all worlds
    confidence: Annotated[float, CONFIDENCE] = 0.95

    def __post_init__(self) -> None:
        if (self.at_least is None) == (self.at_most is None):
            raise InputError("must have either at_least or at_most; correct it")
        if self.share is not None:
            return
        if self.bounds is None:
            raise InputError(
                f"must have a share of the missions in which {self._name} keeps the limit, or "
                f"within, the bounds of its values, for a limit of its mean; add one of the two"
            )
        low, high = self.bounds
        if not low < self.limit < high:
            raise InputError(
                f"must have a limit that missions can show, between {low:g} and {high:g} and "
                f"neither of them, not {self.limit:g}; correct it"
            )

    @property
    def limit(self) -> float:
        """The number of ``at_least`` or ``at_most``."""
        limit = self.at_most if self.at_least is None else self.at_least
        assert limit is not None
        return limit

    @property
    def bounds(self) -> Sequence[float] | None:
        """The bounds of the quantity, for a mean; None if they are not known."""
        if self.within is not None:
            return self.within
        return (
            NATURAL.get(self.of.rpartition(".")[2]) if isinstance(self.of, str) else self.of.bounds
        )

    @property
    def _name(self) -> str:
        return self.of if isinstance(self.of, str) else self.of.title

    @property
    def text(self) -> str:
        """The requirement in words."""
        relation = "at least" if self.at_most is None else "at most"
        where = "" if self.world is None else f" in {self.world}"
        if self.share is None:
            return f"mean {self._name}{where} {relation} {self.limit:g}"
        return f"{self._name} {relation} {self.limit:g} in {self.share:g} of the missions{where}"

    def judge(
        self, trials: Mapping[int, Trial], agents: Sequence[str], measured: Measured
    ) -> Verdict:
        """Decide the requirement by trials, which are given by their numbers."""
        rows = {
            number: self._read_missions(trial, agents, measured) for number, trial in trials.items()
        }
        values = np.array([math.fsum(row.values()) / len(row) for row in rows.values()])
        result, count = decide(values, self._required, self.confidence)
        low, high = self._bound(values[:count])
        goodness = {
            (number, world): value
            for number, row in islice(rows.items(), count)
            for world, value in row.items()
        }
        value = self._scale(math.fsum(values[:count]) / count)
        worst = min(goodness, key=goodness.__getitem__)
        return Verdict(result, count, value, low, high, self.confidence, worst)

    @property
    def _required(self) -> float:
        """The limit of the mean goodness of missions, from 0 to 1."""
        return self._rate(self.limit) if self.share is None else self.share

    def _read_missions(
        self, trial: Trial, agents: Sequence[str], measured: Measured
    ) -> dict[str, float]:
        """Return how good each mission of a trial is, from 0, the worst, to 1."""
        if not isinstance(self.of, str):
            world = next(iter(trial)) if self.world is None else self.world
            chosen = trial if self.world is None else {world: trial[world]}
            return {world: self._rate_kept(measured(self.of, chosen))}
        worlds = trial if self.world is None else (self.world,)
        return {
            world: self._rate_kept(read_quantity(trial[world], self.of, agents)) for world in worlds
        }

    def _rate_kept(self, value: float) -> float:
        if math.isnan(value):
            return 0.0
        if self.share is None:
            return self._rate(value)
        return float(value >= self.limit if self.at_most is None else value <= self.limit)

    def _rate(self, value: float) -> float:
        """Return how good a value is between the bounds, from 0 to 1."""
        assert self.bounds is not None
        low, high = self.bounds
        share = (min(max(value, low), high) - low) / (high - low)
        return share if self.at_most is None else 1 - share

    def _bound(self, values: Array) -> tuple[float, float]:
        """Return bounds of the mean or the share, each of which holds with the confidence."""
        first, second = sorted(map(self._scale, bound(values, self.confidence)))
        return first, second

    def _scale(self, goodness: float) -> float:
        """Return the mean of the quantity for a mean goodness; of a share it is the share."""
        if self.share is not None:
            return goodness
        assert self.bounds is not None
        low, high = self.bounds
        return low + (high - low) * (goodness if self.at_most is None else 1 - goodness)
