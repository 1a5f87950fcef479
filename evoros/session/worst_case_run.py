"""Looks for the worst cases of the designs of an evaluation, and records what was found."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from evoros.base.rng import generator
from evoros.certificate.validation import bound_rate
from evoros.dispatch.dispatcher import Dispatcher
from evoros.evolution.experiment import Experiment
from evoros.failure.case import MODEL
from evoros.failure.given import GivenFailure
from evoros.mission.mission import Mission
from evoros.mission.outcome import Outcome, judge
from evoros.mission.scenario import Scenario
from evoros.session.design_tables import NamedDesign
from evoros.session.evaluation_record import EvaluationRecord
from evoros.session.status import Display, Status
from evoros.storage.layout import WORST_CASES
from evoros.storage.tables import to_csv
from evoros.terminal.activity import announce
from evoros.worst_cases.case_search import CaseSearch
from evoros.worst_cases.case_trials import CaseTrials
from evoros.worst_cases.worst_cases import WorstCases

COLUMNS = (
    *("source", "design", "number", "case", "failed", "stage", "world", "trials", "completed"),
    *("rate", "low", "high", "confidence", "stops", "smallest", "all_sets"),
)


@dataclass(frozen=True)
class WorstCaseRun:
    """An evaluation that looks for worst cases, while its folder is open."""

    experiment: Experiment
    settings: WorstCases
    designs: Sequence[NamedDesign]
    record: EvaluationRecord
    dispatcher: Dispatcher
    status: Status
    display: Display

    def run(self) -> None:
        """Search for each design in turn, and write what was found.

        Every mission is recorded before the search goes on by its outcome. So a search that is
        resumed tries the same cases, and runs those missions only that are missing.

        Raises:
            InputError: the missions on disk are those of another search.
            RunStopped: a mission was lost; the evaluation can be resumed.
        """
        scenario = self._make_scenario()
        rows: list[Sequence[object]] = [COLUMNS]
        for number, design in enumerate(self.designs):
            search = self._start(scenario, number, design)
            with announce("looking for worst cases"):
                stopping = search.run()
            rows += self._describe_model(number, design)
            for trials in (search.nominal, *search.tried.values()):
                rows += self._describe(design, search, trials, trials in stopping)
        self.record.write_once(WORST_CASES, to_csv(rows))

    def _make_scenario(self) -> Scenario:
        """Return the scenario of stated cases; other sensors than those of a case do not fail."""
        return replace(self.experiment.scenario, failure=GivenFailure(effect=self.settings.effect))

    def _start(self, scenario: Scenario, number: int, design: NamedDesign) -> CaseSearch:
        plan = self.experiment.plan

        def try_cases(
            cases: Sequence[CaseTrials], repeats: range
        ) -> list[Mapping[str, list[Outcome]]]:
            missions = [
                plan.stated(number, design.design, each.case, each.number, repeats)
                for each in cases
            ]
            needed = list(chain.from_iterable(missions))
            self.display.begin(0, len(needed), sum(map(self.record.has, needed)))
            self.dispatcher.run_missing(scenario, needed, self.record, self.status.mission)
            return [self._sort_by_world(of_case) for of_case in missions]

        key = f"{self.experiment.seed}/worst_cases/{number}"
        return CaseSearch(
            self.settings,
            len(design.design.mounts),
            len(self.experiment.world),
            try_cases,
            generator(key, "search"),
        )

    def _sort_by_world(self, missions: Sequence[Mission]) -> Mapping[str, list[Outcome]]:
        found: dict[str, list[Outcome]] = {}
        for mission in missions:
            found.setdefault(mission.world, []).append(judge(self.record.find_stated(mission)))
        return found

    def _describe_model(self, number: int, design: NamedDesign) -> list[list[object]]:
        """Return the rows of the trials under the failure model, one for each world."""
        rates, trials = self.record.rates(number), self.experiment.trials
        rows: list[list[object]] = []
        for world, rate in rates.items():
            completed = round(rate * trials)
            bounds = bound_rate(completed, trials, self.settings.confidence)
            counts = (world, trials, completed, rate, *bounds, self.settings.confidence)
            key = (design.source, design.name, 0, "", math.nan, MODEL)
            rows.append([*key, *counts, False, False, False])
        return rows

    def _describe(
        self, design: NamedDesign, search: CaseSearch, trials: CaseTrials, smallest: bool
    ) -> list[list[object]]:
        """Return the rows of a case, one for each world."""
        stopped = search.list_stopped(trials)
        every = len(trials.case.sensors) in search.whole
        rows: list[list[object]] = []
        for world in trials.outcomes:
            completed, count = trials.count(world)
            bounds = bound_rate(completed, count, self.settings.confidence)
            case = (trials.number, trials.case.text, len(trials.case.sensors), trials.stage)
            rates = (completed / count, *bounds)
            says = (self.settings.confidence, world in stopped, smallest, every)
            rows.append([design.source, design.name, *case, world, count, completed, *rates, *says])
        return rows
