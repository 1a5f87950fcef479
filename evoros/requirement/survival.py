"""A requirement that failures of sensors do not stop a design, by all cases or by a search."""

from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import COUNT, FLAG, checked
from evoros.certificate.validation import bound_rate
from evoros.failure.case import CONFIRMED
from evoros.requirement.verdict import MET, UNDECIDED, VIOLATED, Verdict
from evoros.worst_cases.case_search import CaseSearch
from evoros.worst_cases.case_trials import CaseTrials


@dataclass(frozen=True)
@checked
class Survival:
    """No set of up to so many failed sensors stops the design, as ``worst_cases`` looks for it.

    A design that completes a world too rarely without any failure survives nothing. With
    ``all_sets`` all sets must have been tried; otherwise it is enough that the search found none
    that stops the design.
    """

    survives: Annotated[int, COUNT]  # sensors that fail
    all_sets: Annotated[bool, FLAG] = True

    @property
    def text(self) -> str:
        """The requirement in words."""
        sensors = "1 sensor" if self.survives == 1 else f"up to {self.survives} sensors"
        if self.all_sets:
            return f"survives every failure of {sensors}"
        return f"no failure of {sensors} is found that stops it"

    def judge(self, search: CaseSearch) -> tuple[CaseTrials, Verdict]:
        """Return the worst case and the verdict; its ``worst`` has the repeat of the case.

        The search must be finished.
        """
        nominal, below = search.nominal, search.settings.stops_below
        if any(rate_of(nominal, world) < below for world in nominal.outcomes):
            return nominal, _describe(VIOLATED, nominal, search)
        confirmed = [
            trials
            for trials in search.tried.values()
            if trials.stage == CONFIRMED and len(trials.case.sensors) <= self.survives
        ]
        worst = min(confirmed or [nominal], key=lambda trials: trials.severity)
        if any(map(search.list_stopped, confirmed)):
            return worst, _describe(VIOLATED, worst, search)
        sizes = range(1, min(self.survives, search.sensors) + 1)
        complete = search.whole.issuperset(sizes)
        result = MET if complete or not self.all_sets else UNDECIDED
        return worst, _describe(result, worst, search)


def _describe(result: str, worst: CaseTrials, search: CaseSearch) -> Verdict:
    """Return the verdict with the rate of completion in the worst world of the worst case."""
    confidence = search.settings.confidence
    world = min(worst.outcomes, key=lambda world: rate_of(worst, world))
    completed, count = worst.count(world)
    low, high = bound_rate(completed, count, confidence)
    lost = [not outcome.completed for outcome in worst.outcomes[world]]
    first = lost.index(True) if any(lost) else 0
    repeat = search.settings.screening + first
    case = worst.case.text
    return Verdict(result, count, completed / count, low, high, confidence, (repeat, world), case)


def rate_of(trials: CaseTrials, world: str) -> float:
    """Return the share of a case's missions in a world that were completed."""
    completed, count = trials.count(world)
    return completed / count
