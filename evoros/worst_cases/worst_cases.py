"""A search for the smallest set of sensors whose failure stops a design."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, combinations
from typing import Annotated

from numpy.random import Generator

from evoros.base import checks
from evoros.base.errors import InputError
from evoros.certificate.rates import bound_difference, bound_rate, share_level
from evoros.certificate.validation import CONFIDENCE
from evoros.failure.protocol import CONFIRMED, NOMINAL, SCREENED, Case
from evoros.mission.mission import Outcome


@dataclass(frozen=True)
@checks.checked
class WorstCases:
    """A search for the failures of one sensor, then of two, and so on, that stop a design.

    If there are at most ``max_cases`` cases of a size, all sets of sensors are tried at all
    ``times_s``. Otherwise the worst smaller sets are extended by one sensor. The search then tries
    ``rounds`` of ``population`` mutants of the worst cases, in which a sensor or a failure time is
    changed. Each case has up to ``screening`` trials, and the worst ``candidates`` of a size have
    ``trials`` fresh trials. A case stops a design if the completion rate in a world is below
    ``stops_below`` and below the rate without failures.
    """

    most: Annotated[int, checks.COUNT] = 6  # maximum number of failed sensors
    # times at which sets of sensors fail
    times_s: Annotated[Sequence[float], checks.NOT_NEGATIVES] = (0.0, 40.0, 80.0)
    latest_s: Annotated[float, checks.NOT_NEGATIVE] = 80.0  # maximum failure time of a mutant
    max_cases: Annotated[int, checks.COUNT] = 500  # all are tried up to this number per size
    rounds: Annotated[int, checks.WHOLE] = 2  # rounds of mutants per size
    population: Annotated[int, checks.COUNT] = 24  # mutants per round
    screening: Annotated[int, checks.COUNT] = 6  # trials per case; 2 if both are completed
    candidates: Annotated[int, checks.COUNT] = 3  # cases per size with fresh trials
    trials: Annotated[int, checks.COUNT] = 40  # fresh trials per candidate, and without failures
    stops_below: Annotated[float, checks.FRACTION] = 0.5  # limit on the completion rate in a world
    confidence: Annotated[float, CONFIDENCE] = 0.95  # confidence of the result and of each interval

    def __post_init__(self) -> None:
        if self.latest_s < min(self.times_s):
            raise InputError(
                "worst_cases.latest_s: must be at least the smallest of worst_cases.times_s "
                f"({min(self.times_s):g}), not {self.latest_s:g}; raise latest_s"
            )


A_SEARCH = checks.instance_of(
    WorstCases, "a search for worst cases (evoros.worst_cases.worst_cases.WorstCases)"
)


@dataclass(eq=False)
class CaseTrials:
    """The outcomes of a case by world, in the order of trials."""

    case: Case
    number: int  # index in the order of cases
    stage: str = SCREENED
    outcomes: dict[str, list[Outcome]] = field(default_factory=dict)

    def add(self, further: Mapping[str, Sequence[Outcome]]) -> None:
        """Add the outcomes of further trials."""
        for world, outcomes in further.items():
            self.outcomes.setdefault(world, []).extend(outcomes)

    def count(self, world: str) -> tuple[int, int]:
        """Return the number of completed missions and of all missions in a world."""
        outcomes = self.outcomes[world]
        return sum(outcome.completed for outcome in outcomes), len(outcomes)

    @property
    def severity(self) -> tuple[float, float]:
        """The minimum completion rate and mean progress over the worlds; lower is worse."""
        rates, progress = [], []
        for world, outcomes in self.outcomes.items():
            completed, trials = self.count(world)
            # Two imaginary trials, one of them completed, move the rate toward one half.
            rates.append((completed + 1) / (trials + 2))
            done = [
                0.0 if math.isnan(outcome.progress) else outcome.progress for outcome in outcomes
            ]
            progress.append(sum(done) / len(done))
        return min(rates), min(progress)

    @property
    def lost_any(self) -> bool:
        """True if any mission was not completed."""
        return not all(outcome.completed for outcome in chain(*self.outcomes.values()))

    def list_stopped(self, nominal: "CaseTrials", below: float, confidence: float) -> list[str]:
        """Return the worlds with a rate below the limit and below the rate without failures."""
        stopped = []
        for world in self.outcomes:
            failed, whole = self.count(world), nominal.count(world)
            _, high = bound_rate(*failed, confidence)
            _, difference = bound_difference(failed, whole, confidence)
            if high < below and difference < 0:
                stopped.append(world)
        return stopped


Try = Callable[[Sequence[CaseTrials], range], list[Mapping[str, list[Outcome]]]]
"""Runs the given trials of cases, and returns the outcomes of each case by world."""

FIRST_TRIALS = 2  # initial number of trials; a case that completes them has no others


@dataclass
class CaseSearch:
    """The search for a design's worst cases, based on mission outcomes."""

    settings: WorstCases
    sensors: int
    worlds: int
    try_cases: Try
    rng: Generator
    tried: dict[Case, CaseTrials] = field(default_factory=dict)
    nominal: CaseTrials = field(init=False)
    confirmed: list[CaseTrials] = field(default_factory=list)
    whole: set[int] = field(default_factory=set)  # set sizes of which all sets were tried

    def run(self) -> list[CaseTrials]:
        """Return the smallest cases that stop the design; empty if no case does."""
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
        cases = self.tried.values()
        return sorted((trials for trials in cases if len(trials.case.sensors) == size), key=_rank)

    def _confirm(self, ranked: Sequence[CaseTrials]) -> list[CaseTrials]:
        """Run the worst cases on fresh draws; return those that stop the design."""
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
        """Remove sensors from the worst case while the remaining ones still stop the design.

        The result is 1-minimal: no case with one sensor fewer stopped the design (Zeller and
        Hildebrandt, Simplifying and isolating failure-inducing input, IEEE Transactions on Software
        Engineering 28, 2002). If all sets were tried, the result is the smallest one.
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
    return trials.severity, trials.number
