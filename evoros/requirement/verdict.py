"""Verdicts on requirements, and their text."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from evoros.base.errors import MAX_DIGITS, count_digits, write_count
from evoros.mission.mission import Outcomes

MET, VIOLATED, UNDECIDED = "met", "violated", "undecided"
PERCENT = "%"  # printed unit of shares, which are numbers from 0 to 1 in tables
Trial = Mapping[str, Outcomes]  # outcomes of a trial by world


@dataclass(frozen=True)
class Verdict:
    """The result of testing a requirement, and the worst mission."""

    result: str  # MET, VIOLATED or UNDECIDED
    trials: int  # number of trials until the decision, or of all trials
    value: float  # mean or share over all trials
    low: float  # lower bound with the given confidence
    high: float
    confidence: float
    limit: float  # required value
    unit: str  # PERCENT for shares from 0 to 1, otherwise empty
    worst: tuple[int, str]  # trial and world of the worst mission
    further: float = 0.0  # expected further trials until a decision, may be infinite
    tends: str = ""  # expected result, MET or VIOLATED; empty if decided or unknown
    decided_by: str = ""  # name of the deciding level, if there are several

    @property
    def text(self) -> str:
        """The numbers behind the result and, unless it is met, the worst mission."""
        value, low, high = self._write_numbers()
        unit = f" {self.unit}" if self.unit else ""
        text = (
            f"{value}{unit} in {write_count(self.trials, 'trial')} "
            f"({100 * self.confidence:g} % bounds {low} to {high}{unit})"
        )
        if self.decided_by:
            text = f"with {self.decided_by}: {text}"
        if self.result == MET:
            return text
        if self.result == UNDECIDED:
            more = f"about {self.further:.0f} more trials would probably be enough"
            if math.isinf(self.further):
                more = (
                    "more trials would probably not be enough, because the value is close "
                    "to the limit"
                )
            text += f"; {more}"
        trial, world = self.worst
        return f"{text}; the worst mission is trial {trial} in {world}"

    def _write_numbers(self) -> list[str]:
        """Format the value and its bounds with enough digits to tell the bounds from the limit."""
        scale = 100 if self.unit == PERCENT else 1
        numbers = [scale * number for number in (self.value, self.low, self.high)]
        digits = count_digits(numbers[2] - numbers[1])
        limit = scale * self.limit
        while digits < MAX_DIGITS and any(
            number != limit and round(number, digits) == round(limit, digits)
            for number in numbers[1:]
        ):
            digits += 1
        return [f"{number:.{digits}f}" for number in numbers]


def write_percent(share: float) -> str:
    """Format a share from 0 to 1 in percent."""
    return f"{100 * share:g} {PERCENT}"


def conclude(levels: Mapping[str, Verdict]) -> Verdict:
    """Return the verdict on a requirement from the verdicts on its levels by name.

    The requirement is met if all levels are met, violated if any level is violated, and otherwise
    undecided. The numbers are those for the first violated level or, if all are met, for the last
    to be met. Otherwise, they are for the undecided level that would first be violated by trials
    like those so far, or be met last.
    """
    verdicts = [
        verdict if len(levels) == 1 and not name else replace(verdict, decided_by=name)
        for name, verdict in levels.items()
    ]
    if violated := [one for one in verdicts if one.result == VIOLATED]:
        return min(violated, key=lambda one: one.trials)
    if undecided := [one for one in verdicts if one.result == UNDECIDED]:
        falling = [one for one in undecided if one.tends == VIOLATED]
        if falling:
            return min(falling, key=lambda one: one.further)
        return max(undecided, key=lambda one: one.further)
    return max(verdicts, key=lambda one: one.trials)
