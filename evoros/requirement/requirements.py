"""The named requirements of an evaluation, and the levels at which they must hold."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Annotated, Any

from evoros.base.checks import COUNT, NAME, NOT_NEGATIVES, checked, list_rules, mapping_of
from evoros.base.errors import InputError
from evoros.certificate.validation import CONFIDENCE
from evoros.failure.protocol import Case
from evoros.requirement.claim import (
    FAILED_SENSOR,
    OWN,
    SHARE,
    WORLD,
    Claim,
    Condition,
    Measured,
    Trials,
    require_column,
)
from evoros.requirement.verdict import MET, UNDECIDED, VIOLATED, Verdict, conclude, write_percent


@dataclass(frozen=True)
@checked
class Survival:
    """A minimum completion rate in each world after failures of any ``survives`` sensors.

    The completion rate must exceed ``stops_below`` in each world, both with all sensors intact and
    after each set of sensors fails at any of ``times_s``.
    """

    survives: Annotated[int, COUNT]  # maximum number of failed sensors
    stops_below: Annotated[float, SHARE] = 0.5  # limit on completion rates
    times_s: Annotated[Sequence[float], NOT_NEGATIVES] = (0.0, 40.0, 80.0)  # failure times of a set
    max_cases: Annotated[int, COUNT] = 500  # maximum number of pairs of set and failure time
    confidence: Annotated[float, CONFIDENCE] = 0.95

    @property
    def text(self) -> str:
        """The requirement in words."""
        sensors = "any 1 sensor" if self.survives == 1 else f"any {self.survives} or fewer sensors"
        *times, last = (f"{time:g}" for time in self.times_s)
        when = f"{', '.join(times)} or {last}" if times else last
        return (
            f"completed in at least {write_percent(self.stops_below)} of the missions in each "
            f"world, with {sensors} failed at {when} s"
        )

    def claim_for(self, world: str | None) -> Claim:
        """Return the claim that each case must meet in a world."""
        limit, confidence = self.stops_below, self.confidence
        return Claim("completed", at_least=limit, world=world, confidence=confidence)

    @property
    def fewest_trials(self) -> int:
        """The minimum number of trials per case that meet the requirement."""
        return self.claim_for(None).fewest_trials

    def list_cases(self, sensors: int) -> Iterator[Case]:
        """Yield the cases for a number of sensors, starting with the intact case."""
        if self.survives > sensors:
            raise InputError(
                f"survives: must be at most {sensors}, the number of sensors, not {self.survives}"
            )
        sizes = range(1, self.survives + 1)
        count = 1 + len(self.times_s) * sum(math.comb(sensors, size) for size in sizes)
        if count > self.max_cases:
            raise InputError(
                f"max_cases: must be at least {count}, the number of cases (sets of "
                f"up to {self.survives} of {sensors} sensors, each at each of times_s), not "
                f"{self.max_cases}; raise max_cases, lower survives, or list fewer times_s"
            )
        yield Case()
        for size in sizes:
            for chosen in combinations(range(sensors), size):
                for time in self.times_s:
                    yield Case.of((sensor, time) for sensor in chosen)


Requirement = Claim | Survival


@dataclass(frozen=True)
class Level:
    """A claim about missions under a condition."""

    text: str  # value in the column ``level``; empty for claims without levels
    condition: Condition
    claim: Claim


def list_levels(
    requirement: Requirement, worlds: Sequence[str], sensors: int | None = None
) -> list[Level]:
    """List a requirement's levels; levels with failed sensors need the number of ``sensors``."""
    if isinstance(requirement, Survival):
        return [
            Level(f"{case.text} in {world}", Condition(case), requirement.claim_for(world))
            for case in (() if sensors is None else requirement.list_cases(sensors))
            for world in worlds
        ]
    factor, values = requirement.factor, requirement.values
    claim = replace(requirement, each=None)
    if not factor:
        return [Level("", OWN, claim)]
    if factor == WORLD:
        names = [str(value) for value in values or worlds]
        return [Level(f"world={name}", OWN, replace(claim, world=name)) for name in names]
    if factor == FAILED_SENSOR:
        return list(_list_failures(claim, values or (0.0,), sensors))
    assert isinstance(values, Mapping)
    conditions = (Condition(None, factor, name, part) for name, part in values.items())
    return [Level(condition.text, condition, claim) for condition in conditions]


def _list_failures(claim: Claim, times_s: Sequence[float], sensors: int | None) -> Iterator[Level]:
    if sensors == 0:
        raise InputError("each: the design has no sensor that can fail; leave out the key each")
    for sensor in range(sensors or 0):
        for time in times_s:
            case = Case.of([(sensor, time)])
            yield Level(f"{FAILED_SENSOR}={case.text}", Condition(case), claim)


REQUIREMENTS = mapping_of(Requirement, "requirements (evoros.requirement.requirements.collect)")


def collect(**requirements: Mapping[str, Any]) -> dict[str, Requirement]:
    """Create requirements by name from their fields."""
    made = {name: _make(name, fields) for name, fields in requirements.items()}
    claims = {name: claim for name, claim in made.items() if isinstance(claim, Claim)}
    for (first, one), (second, other) in combinations(claims.items(), 2):
        if _contradict(one, other):
            raise InputError(
                f"requirements.{first} and requirements.{second}: cannot both be met "
                f"({one.text}; {other.text}); change one of the two limits"
            )
    return made


def _make(name: str, fields: Any) -> Requirement:
    key = f"requirements.{name}"
    if not NAME.holds(name):
        raise InputError(f"{key}: must be {NAME.text}; rename the requirement")
    if not isinstance(fields, Mapping):
        raise InputError(
            f"{key}: must be a mapping, as in {{of: completed, at_least: 0.9}}, not {fields!r}"
        )
    kind, first = (Survival, "survives") if "survives" in fields else (Claim, "of")
    known = [rule_of for rule_of, _, _ in list_rules(kind)]
    unknown = [field for field in fields if field not in known]
    if unknown or first not in fields:
        fix = "remove the others" if unknown else f"add {first}"
        raise InputError(
            f"{key}: must have the key {first} and may have only {', '.join(known)}, but has "
            f"{', '.join(map(str, unknown or fields))}; {fix}"
        )
    try:
        return kind(**fields)
    except InputError as error:
        raise InputError(f"{key}: {error}") from None


def check_requirements(
    requirements: Mapping[str, Requirement], worlds: Sequence[str], agents: Sequence[str]
) -> None:
    """Check that the columns, worlds and parts named in requirements exist."""
    for name, claim in requirements.items():
        if isinstance(claim, Survival):
            continue
        if isinstance(claim.of, str):
            require_column(f"requirements.{name}.of", claim.of, agents)
        stated = claim.values or () if claim.factor == WORLD else ()
        for key, world in (("world", claim.world), *(("each.world", one) for one in stated)):
            if world is not None and world not in worlds:
                raise InputError(
                    f"requirements.{name}.{key}: must be one of {', '.join(worlds)}, not "
                    f"{world!r}; choose one of these, or add that world to the evaluation"
                )
    list_conditions(requirements)


def list_conditions(requirements: Mapping[str, Requirement]) -> dict[str, Condition]:
    """Return, by text, the conditions that replace parts; names of parts must be unique."""
    conditions: dict[str, Condition] = {}
    for name, requirement in requirements.items():
        for level in list_levels(requirement, ()):
            text, part = level.condition.text, level.condition.part
            known = conditions.setdefault(text, level.condition) if text else level.condition
            if repr(known.part) != repr(part):
                raise InputError(
                    f"requirements.{name}.each: {text} is also the name of a different part in "
                    "another requirement; rename one of the parts"
                )
    return conditions


def need_conditions(requirement: Requirement) -> bool:
    """Return True if a requirement needs missions under conditions other than ``OWN``."""
    return isinstance(requirement, Survival) or requirement.factor not in ("", WORLD)


def _contradict(one: Claim, other: Claim) -> bool:
    if (one.of, one.world, one.each) != (other.of, other.world, other.each):
        return False
    for lower, upper in ((one, other), (other, one)):
        if lower.at_least is None or upper.at_most is None or lower.at_least <= upper.at_most:
            continue
        shares = (lower.share, upper.share)
        if shares == (None, None) or (None not in shares and sum(map(float, shares)) > 1):  # type: ignore[arg-type]
            return True
    return False


ROUND = 10  # number of trials between tests of undecided requirements


@dataclass(frozen=True)
class Judged:
    """The verdict on a requirement and, if there are several levels, on each level."""

    whole: Verdict
    levels: Mapping[str, Verdict] = field(default_factory=dict)


class Assessment:
    """Tests a design's requirements, and requests the trials that this needs.

    Decided levels need no further trials, and one violated level decides a survival requirement, so
    the number of trials depends on the outcomes. ``trials`` is the maximum under each condition,
    and ``first`` the minimum under the evaluation's conditions. An InputError says that a
    requirement has no levels for the number of ``sensors``.
    """

    def __init__(
        self,
        requirements: Mapping[str, Requirement],
        worlds: Sequence[str],
        sensors: int,
        trials: int,
        first: int = ROUND,
    ) -> None:
        self._worlds, self._most = worlds, trials
        self._requirements = requirements
        self._levels = {
            name: _list_levels(name, requirement, worlds, sensors)
            for name, requirement in requirements.items()
        }
        self._results = {name: [UNDECIDED] * len(of) for name, of in self._levels.items()}
        self.wanted = {OWN: min(first, trials)}
        """The number of trials requested under each condition."""
        for level in (level for of in self._levels.values() for level in of):
            self.wanted.setdefault(level.condition, min(ROUND, trials))
        self.conditions = list(self.wanted)
        self.finished = False

    def list_worlds(self, condition: Condition) -> list[str]:
        """List the worlds that need missions under a condition."""
        levels = [one for of in self._levels.values() for one in of if one.condition == condition]
        named = {level.claim.world for level in levels}
        everywhere = condition == OWN or None in named
        return [world for world in self._worlds if everywhere or world in named]

    def advance(
        self, known: Mapping[Condition, Trials], agents: Sequence[str], measured: Measured
    ) -> None:
        """Test the undecided levels with all trials so far; request more trials where needed."""
        for name, levels in self._levels.items():
            results = self._results[name]
            for place in self._list_open(name):
                level = levels[place]
                trials = known[level.condition]
                results[place] = level.claim.decide(trials, agents, measured, len(levels))
        needed = {
            self._levels[name][place].condition
            for name in self._levels
            for place in self._list_open(name)
        }
        growing = [one for one in needed if self.wanted[one] < self._most]
        for condition in growing:
            self.wanted[condition] = min(self.wanted[condition] + ROUND, self._most)
        self.finished = not growing

    def _list_open(self, name: str) -> list[int]:
        results = self._results[name]
        if isinstance(self._requirements[name], Survival) and VIOLATED in results:
            return []
        return [place for place, result in enumerate(results) if result == UNDECIDED]

    def result(self, name: str) -> str:
        """Return a requirement's current result."""
        results = self._results[name]
        return next((one for one in (VIOLATED, UNDECIDED) if one in results), MET)

    def judge(
        self, known: Mapping[Condition, Trials], agents: Sequence[str], measured: Measured
    ) -> dict[str, Judged]:
        """Return the verdicts on all requirements by name."""

        def judge(level: Level, tests: int) -> Verdict:
            return level.claim.judge(known[level.condition], agents, measured, tests)

        judged = {}
        for name, levels in self._levels.items():
            verdicts = {level.text: judge(level, len(levels)) for level in levels}
            shown = verdicts if getattr(self._requirements[name], "each", None) else {}
            judged[name] = Judged(conclude(verdicts), shown)
        return judged


def _list_levels(
    name: str, requirement: Requirement, worlds: Sequence[str], sensors: int
) -> list[Level]:
    try:
        return list_levels(requirement, worlds, sensors)
    except InputError as error:
        raise InputError(f"requirements.{name}.{error}") from None
