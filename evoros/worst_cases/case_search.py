"""Finds the smallest set of sensors whose failure stops a design."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

from numpy.random import Generator

from evoros.failure.case import CONFIRMED, NOMINAL, Case
from evoros.mission.outcome import Outcome
from evoros.worst_cases.case_trials import CaseTrials, share_level
from evoros.worst_cases.worst_cases import WorstCases

Try = Callable[[Sequence[CaseTrials], range], list[Mapping[str, list[Outcome]]]]
"""Runs repeats of cases and returns, for each, their outcomes in each world."""

FIRST_TRIALS = 2
"""The first trials of a screened case, which gets no more if it completes all."""


@dataclass
class CaseSearch:
    """The search for the worst cases of one design; the outcomes determine its steps."""

    settings: WorstCases
    sensors: int
    worlds: int
    try_cases: Try
    rng: Generator
    tried: dict[Case, CaseTrials] = field(default_factory=dict)
    nominal: CaseTrials = field(init=False)
    confirmed: list[CaseTrials] = field(default_factory=list)
    whole: set[int] = field(default_factory=set)
    """Numbers of failed sensors of which all sets were tried."""

    def run(self) -> list[CaseTrials]:
        """Return the smallest cases that stop the design; empty if none does."""
        settings = self.settings
        self.nominal = CaseTrials(Case(), 0, NOMINAL)
        fresh = range(settings.screening, settings.screening + settings.trials)
        self.nominal.add(*self.try_cases([self.nominal], fresh))
        for size in range(1, min(settings.most, self.sensors) + 1):
            self._search(size)
            stopping = self._confirm(self._list_tried(size))
            if stopping:
                return self._reduce(stopping)
        return []

    def _search(self, size: int) -> None:
        """Screen cases of one size: all sets, or those that grow from bad ones; then mutants."""
        settings = self.settings
        count = math.comb(self.sensors, size) * len(settings.times_s)
        if count <= settings.max_cases:
            self._screen(
                Case.of((sensor, time) for sensor in chosen)
                for chosen in combinations(range(self.sensors), size)
                for time in settings.times_s
            )
            self.whole.add(size)
        else:
            self._screen(self._grow(size))
        for _ in range(settings.rounds):
            parents = self._list_tried(size)[: max(1, settings.population // 4)]
            if parents:
                chosen = [parents[i % len(parents)] for i in range(settings.population)]
                self._screen(self._mutate(parent.case) for parent in chosen)

    def _grow(self, size: int) -> list[Case]:
        """Add each other sensor to the worst cases with one failure less, at the same time."""
        settings = self.settings
        smaller = [trials.case for trials in self._list_tried(size - 1)] or [Case()]
        grown: dict[Case, None] = {}
        for case in smaller:
            for sensor in sorted(set(range(self.sensors)) - set(case.sensors)):
                for time in case.times_s[-1:] or settings.times_s:
                    known = zip(case.sensors, case.times_s, strict=True)
                    grown[Case.of([*known, (sensor, time)])] = None
            if len(grown) >= settings.max_cases:
                break
        return list(grown)[: settings.max_cases]

    def _mutate(self, case: Case) -> Case:
        """Exchange one sensor for another, or move the time of one failure."""
        failures = dict(zip(case.sensors, case.times_s, strict=True))
        place, kind, share = self.rng.random(), self.rng.random(), self.rng.random()
        sensor = case.sensors[int(place * len(case.sensors))]
        others = sorted(set(range(self.sensors)) - set(case.sensors))
        if others and kind < 0.5:
            failures[others[int(share * len(others))]] = failures.pop(sensor)
        else:
            low, high = min(self.settings.times_s), self.settings.latest_s
            failures[sensor] = round(low + share * (high - low), 1)
        return Case.of(failures.items())

    def _screen(self, cases: Iterable[Case]) -> None:
        """Try new cases a few times, and cases that are not always completed more often."""
        new = []
        for case in dict.fromkeys(cases):
            if case not in self.tried:
                self.tried[case] = CaseTrials(case, len(self.tried) + 1)
                new.append(self.tried[case])
        most = self.settings.screening
        first = min(FIRST_TRIALS, most)
        self._try(new, range(first))
        self._try([trials for trials in new if trials.lost_any], range(first, most))

    def _try(self, cases: Sequence[CaseTrials], repeats: range) -> None:
        if cases and len(repeats):
            for trials, outcomes in zip(cases, self.try_cases(cases, repeats), strict=True):
                trials.add(outcomes)

    def _list_tried(self, size: int) -> list[CaseTrials]:
        """Return the cases of one size, the worst first."""
        cases = self.tried.values()
        return sorted((trials for trials in cases if len(trials.case.sensors) == size), key=_rank)

    def _confirm(self, ranked: Sequence[CaseTrials]) -> list[CaseTrials]:
        """Try the worst cases on fresh draws; return those that stop the design.

        The trials that made them the worst do not count. The tests of all candidates and worlds
        share the level of one, so that luck stops a design as rarely as ``confidence`` says.
        """
        settings = self.settings
        new = [trials for trials in ranked if trials.lost_any and trials not in self.confirmed]
        chosen = new[: settings.candidates]
        for trials in chosen:
            trials.outcomes, trials.stage = {}, CONFIRMED
        fresh = range(settings.screening, settings.screening + settings.trials)
        self._try(chosen, fresh)
        self.confirmed += chosen
        return [trials for trials in chosen if self.list_stopped(trials)]

    def list_stopped(self, trials: CaseTrials) -> list[str]:
        """Return the worlds in which a confirmed case stops the design."""
        settings = self.settings
        if trials.stage != CONFIRMED:
            return []
        level = share_level(settings.confidence, settings.candidates * self.worlds)
        return trials.list_stopped(self.nominal, settings.stops_below, level)

    def _reduce(self, stopping: list[CaseTrials]) -> list[CaseTrials]:
        """Leave sensors out of the worst case, as long as the others stop the design.

        The result is 1-minimal: without any one of its sensors, the case was not seen to stop the
        design (Zeller and Hildebrandt, Simplifying and isolating failure-inducing input, IEEE
        Transactions on Software Engineering 28, 2002). If all sets were tried, it is smallest.
        """
        case = min(stopping, key=_rank).case
        size = len(case.sensors) - 1
        if size < 1 or size in self.whole:
            return stopping
        failures = list(zip(case.sensors, case.times_s, strict=True))
        smaller = [Case.of([*failures[:i], *failures[i + 1 :]]) for i in range(len(failures))]
        self._screen(smaller)
        less = self._confirm(sorted((self.tried[case] for case in smaller), key=_rank))
        return self._reduce(less) if less else stopping


def _rank(trials: CaseTrials) -> tuple[tuple[float, float], int]:
    """Return the key by which cases are sorted, the worst first."""
    return trials.severity, trials.number
