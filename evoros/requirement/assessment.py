"""Assessment of the requirements of one design, round by round."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from evoros.base.errors import InputError
from evoros.requirement.claim import Measured, Trials
from evoros.requirement.condition import OWN, Condition
from evoros.requirement.requirements import Level, Requirement, Survival, list_levels
from evoros.requirement.verdict import MET, UNDECIDED, VIOLATED, Verdict, conclude

ROUND = 10
"""Trials between two judgements of undecided requirements."""


@dataclass(frozen=True)
class Judged:
    """The verdict on a requirement, and on each of its levels if there are several."""

    whole: Verdict
    levels: Mapping[str, Verdict] = field(default_factory=dict)


class Assessment:
    """Tracks the trials that the requirements of a design need, and judges them.

    Each level is decided by trials under its own condition, and then needs no more. A violated
    level ends a whole survival requirement. The outcomes thus determine the trials. ``trials`` is
    the maximum under each condition, and ``first`` the minimum under the evaluation's conditions.

    Raises:
        InputError: a requirement has no levels for a robot with this number of ``sensors``.
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
        """The number of trials wanted under each condition so far."""
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
        """Judge the undecided levels by all trials so far, and want more trials for the rest."""
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
        """List the indices of the levels that more trials may decide."""
        results = self._results[name]
        if isinstance(self._requirements[name], Survival) and VIOLATED in results:
            return []
        return [place for place, result in enumerate(results) if result == UNDECIDED]

    def result(self, name: str) -> str:
        """Return the result of a requirement so far."""
        results = self._results[name]
        return next((one for one in (VIOLATED, UNDECIDED) if one in results), MET)

    def judge(
        self, known: Mapping[Condition, Trials], agents: Sequence[str], measured: Measured
    ) -> dict[str, Judged]:
        """Return the verdicts over all trials by requirement."""

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
