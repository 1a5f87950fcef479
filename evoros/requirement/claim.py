"""Claims about a design's missions under a condition, decided by sequential tests."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import islice
from typing import Annotated, Any

import numpy as np

from evoros.base.arrays import Array
from evoros.base.checks import MOST, NAME, NOT_NEGATIVES, NUMBER, Rule, checked, is_number
from evoros.base.errors import InputError
from evoros.certificate.rates import share_level
from evoros.certificate.validation import CONFIDENCE
from evoros.failure.protocol import Case
from evoros.measure.protocol import BOUNDS, Measure
from evoros.mission.mission import NOT_RUN, Outcome, Outcomes
from evoros.requirement.bets import bound, decide, estimate_further
from evoros.requirement.verdict import (
    MET,
    PERCENT,
    UNDECIDED,
    VIOLATED,
    Trial,
    Verdict,
    write_percent,
)

FAILED_SENSOR, WORLD = "failed_sensor", "world"
PARTS = ("failure", "walkers", "simulator", "controller")  # replaceable
COMPLETION_TIME = "completion_time_s"  # infinite for incomplete missions
COLUMNS = (
    *(one.name for one in fields(Outcome) if one.type in (bool, int, float)),
    COMPLETION_TIME,
)
_NATURAL = dict.fromkeys(("completed", "progress", "avoiding"), (0.0, 1.0))  # natural bounds


@dataclass(frozen=True)
class Condition:
    """A given case of failed sensors, or a replacement for a part of the experiment."""

    case: Case | None = None  # failures instead of all others
    factor: str = ""  # one of PARTS
    name: str = ""  # name of the replacement
    part: Any = field(default=None, compare=False, repr=False)

    @property
    def text(self) -> str:
        """The value in the column ``case`` of missions; empty for ``OWN``."""
        if self.case is not None:
            return self.case.text
        return f"{self.factor}={self.name}" if self.factor else ""


OWN = Condition()  # the evaluation's conditions, unchanged


def _read_quantity(outcomes: Outcomes, column: str, agents: Sequence[str]) -> float:
    """Return a quantity of a mission; NaN if the mission could not run.

    ``column`` is one of ``COLUMNS``; the prefix ``AGENT.`` selects the value of another robot. The
    time of an event that did not happen, such as a first collision, is infinite.
    """
    name, _, of_robot = column.rpartition(".")
    outcome = outcomes[1 + agents.index(name) if name else 0]
    if outcome.ended in NOT_RUN:
        return math.nan
    if of_robot == COMPLETION_TIME:
        return outcome.time_s if outcome.completed else math.inf
    value = float(getattr(outcome, of_robot))
    return math.inf if math.isnan(value) else value


def require_column(key: str, column: str, agents: Sequence[str]) -> None:
    """Require that missions have a column."""
    name, _, of_robot = column.rpartition(".")
    if (name and name not in agents) or of_robot not in COLUMNS:
        known = ", ".join(COLUMNS) + (f"; of agents {', '.join(agents)}.COLUMN" if agents else "")
        raise InputError(f"{key}: must be a measure or one of {known}, not {column!r}")


QUANTITY = Rule(
    "a column of missions.csv, or a measure", lambda v: isinstance(v, str | Measure), plain=True
)
EACH = Rule(
    f"{FAILED_SENSOR}, {WORLD}, {{{FAILED_SENSOR}: TIMES_S}}, {{{WORLD}: NAMES}}, or one of "
    f"{', '.join(PARTS)} with its parts by name, as in {{failure: {{light: ..., severe: ...}}}}",
    lambda v: v in (FAILED_SENSOR, WORLD) or (isinstance(v, Mapping) and _states_levels(v)),
    plain=True,
)
SHARE = Rule("a number greater than 0 and less than 1", lambda v: is_number(v) and 0 < v < 1)


def _states_levels(each: Mapping[str, Any]) -> bool:
    if len(each) != 1:
        return False
    ((factor, values),) = each.items()
    if factor == FAILED_SENSOR:
        return NOT_NEGATIVES.holds(values)
    if factor == WORLD:
        return isinstance(values, list | tuple) and bool(values) and all(map(NAME.holds, values))
    known = factor in PARTS and isinstance(values, Mapping) and bool(values)
    return known and all(map(NAME.holds, values))


Trials = Mapping[int, Trial]  # trials by number
Measured = Callable[[Measure, Trial], float]  # computes a measure of a trial


@dataclass(frozen=True)
@checked
class Claim:
    """A limit on the mean of a quantity, or on its value in a share of the missions.

    With ``share``, the limit must hold in at least this share of the missions (a quantile).
    Otherwise, the limit applies to the mean of the quantity over trials, clipped to the bounds
    ``within``. A mission that could not run has the worst value. With ``each``, the limit must hold
    at each level of a factor.
    """

    of: Annotated[str | Measure, QUANTITY]
    at_least: Annotated[float | None, NUMBER] = None
    at_most: Annotated[float | None, NUMBER] = None
    share: Annotated[float | None, SHARE] = None
    within: Annotated[Sequence[float] | None, BOUNDS] = None
    world: Annotated[str | None, NAME] = None  # null: missions in all worlds
    each: Annotated[str | Mapping[str, Any] | None, EACH] = None  # a factor, or {factor: levels}
    confidence: Annotated[float, CONFIDENCE] = 0.95

    def __post_init__(self) -> None:
        if self.factor == WORLD and self.world is not None:
            raise InputError("must have either world or each: world; leave out one of the two")
        if (self.at_least is None) == (self.at_most is None):
            raise InputError("must have either at_least or at_most; keep one of the two")
        if self.share is not None:
            return
        if self.bounds is None:
            raise InputError(
                f"must have either share (the fraction of missions in which {self._name} must meet "
                f"the limit) or within (the bounds of {self._name}, if the limit is on the mean); "
                f"add one of the two"
            )
        low, high = self.bounds
        if not low < self.limit < high:
            raise InputError(
                f"the limit must be between {low:g} and {high:g}, the bounds of the quantity, "
                f"not {self.limit:g}"
            )

    @property
    def limit(self) -> float:
        """The value of ``at_least`` or ``at_most``."""
        limit = self.at_most if self.at_least is None else self.at_least
        assert limit is not None
        return limit

    @property
    def bounds(self) -> Sequence[float] | None:
        """The bounds of a quantity whose mean is limited; None if unknown."""
        if self.within is not None:
            return self.within
        return (
            _NATURAL.get(self.of.rpartition(".")[2]) if isinstance(self.of, str) else self.of.bounds
        )

    @property
    def factor(self) -> str:
        """The factor of ``each``; empty if there is none."""
        return next(iter(self.each)) if isinstance(self.each, Mapping) else self.each or ""

    @property
    def values(self) -> Any:
        """The configured levels of the factor; None for all levels."""
        return self.each[self.factor] if isinstance(self.each, Mapping) else None

    @property
    def _name(self) -> str:
        return self.of if isinstance(self.of, str) else self.of.title

    @property
    def text(self) -> str:
        """The requirement in words."""
        relation = "at least" if self.at_most is None else "at most"
        where = "" if self.world is None else f" in {self.world}"
        every = f", with each {self.factor}" if self.factor else ""
        limit = f"{relation} {self.limit:g}"
        if self.share is not None:
            share = f"at least {write_percent(self.share)} of the missions"
            return f"{self._name} {limit} in {share}{where}{every}"
        if self.unit:
            limit = f"{relation} {write_percent(self.limit)}"
        if self._name.rpartition(".")[2] == "completed":
            return f"{self._name} in {limit} of the missions{where}{every}"
        return f"mean {self._name}{where} {limit}{every}"

    @property
    def unit(self) -> str:
        """The unit: PERCENT for shares of missions and quantities from 0 to 1, otherwise empty."""
        natural = self.within is None and isinstance(self.of, str)
        return PERCENT if self.share is not None or natural else ""

    @property
    def fewest_trials(self) -> int:
        """The minimum number of trials, all of them perfect, that meet the claim."""
        best = estimate_further(np.ones(1), self._required, self.confidence)
        return 1 + int(min(best, MOST))

    def decide(
        self, trials: Trials, agents: Sequence[str], measured: Measured, tests: int = 1
    ) -> str:
        """Return the result of ``judge`` without bounds, which take most of the time."""
        values = self._average(self._read_trials(trials, agents, measured))
        return decide(values, self._required, self.confidence, tests)[0]

    def judge(
        self, trials: Trials, agents: Sequence[str], measured: Measured, tests: int = 1
    ) -> Verdict:
        """Decide the requirement from trials."""
        rows = self._read_trials(trials, agents, measured)
        values = self._average(rows)
        result, count = decide(values, self._required, self.confidence, tests)
        bounds = bound(values[:count], self.confidence, tests)
        low, high = sorted(map(self._scale, bounds))
        goodness = {
            (number, world): value
            for number, row in islice(rows.items(), count)
            for world, value in row.items()
        }
        value = self._scale(math.fsum(values[:count]) / count)
        worst = min(goodness, key=goodness.__getitem__)
        limit = self.limit if self.share is None else self.share
        numbers = (value, low, high, self.confidence, limit)
        verdict = Verdict(result, count, *numbers, self.unit, worst)
        return self._foresee(verdict, values, tests) if result == UNDECIDED else verdict

    def _foresee(self, verdict: Verdict, values: Array, tests: int) -> Verdict:
        """Add the expected result, and the number of further trials expected to reach it."""
        violated = share_level(self.confidence, tests)
        further = {
            MET: estimate_further(values, self._required, self.confidence),
            VIOLATED: estimate_further(1 - values, 1 - self._required, violated),
        }
        tends = min(further, key=further.__getitem__)
        if not math.isfinite(further[tends]):
            return replace(verdict, further=math.inf)
        step = 10 ** max(0, len(str(further[tends])) - 2)  # estimates are rounded to two digits
        return replace(verdict, further=math.ceil(further[tends] / step) * step, tends=tends)

    def _read_trials(
        self, trials: Trials, agents: Sequence[str], measured: Measured
    ) -> dict[int, dict[str, float]]:
        return {
            number: self._read_missions(trial, agents, measured) for number, trial in trials.items()
        }

    @staticmethod
    def _average(rows: Mapping[int, Mapping[str, float]]) -> Array:
        return np.array([math.fsum(row.values()) / len(row) for row in rows.values()])

    @property
    def _required(self) -> float:
        return self._rate(self.limit) if self.share is None else self.share

    def _read_missions(
        self, trial: Trial, agents: Sequence[str], measured: Measured
    ) -> dict[str, float]:
        if not isinstance(self.of, str):
            world = next(iter(trial)) if self.world is None else self.world
            chosen = trial if self.world is None else {world: trial[world]}
            return {world: self._rate_kept(measured(self.of, chosen))}
        worlds = trial if self.world is None else (self.world,)
        return {
            world: self._rate_kept(_read_quantity(trial[world], self.of, agents))
            for world in worlds
        }

    def _rate_kept(self, value: float) -> float:
        if math.isnan(value):
            return 0.0
        if self.share is None:
            return self._rate(value)
        return float(value >= self.limit if self.at_most is None else value <= self.limit)

    def _rate(self, value: float) -> float:
        assert self.bounds is not None
        low, high = self.bounds
        share = (min(max(value, low), high) - low) / (high - low)
        return share if self.at_most is None else 1 - share

    def _scale(self, goodness: float) -> float:
        if self.share is not None:
            return goodness
        assert self.bounds is not None
        low, high = self.bounds
        return low + (high - low) * (goodness if self.at_most is None else 1 - goodness)
