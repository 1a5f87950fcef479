"""Looks for the worst cases of the designs of an evaluation, and records them."""

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
from evoros.requirement.survival import Survival
from evoros.session.design_tables import NamedDesign
from evoros.session.evaluation_record import EvaluationRecord
from evoros.session.status import Status
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

    def run(self) -> None:
        """Search for each design in turn, and write the cases.

        Every mission is recorded before the search goes on by its outcome. So a search that is
        resumed tries the same cases, and runs only the missing missions.

        Raises:
            InputError: the missions on disk are of another search.
            RunStopped: a mission was lost; the evaluation can be resumed.
        """
        scenario = state_failures(self.experiment)
        rows: list[Sequence[object]] = [COLUMNS]
        for index, design in enumerate(self.designs):
            search = self._start(scenario, index, design)
            with announce("looking for worst cases"):
                stopping = search.run()
            self._judge(index, design, search)
            rows += self._describe_model(index, design)
            for trials in (search.nominal, *search.tried.values()):
                rows += self._describe(design, search, trials, trials in stopping)
        self.record.write_once(WORST_CASES, to_csv(rows))

    def _judge(self, index: int, design: NamedDesign, search: CaseSearch) -> None:
        """Decide the requirements that are about the cases of a design."""
        for name, requirement in self.experiment.requirements.items():
            if isinstance(requirement, Survival):
                worst, verdict = requirement.judge(search)
                repeat, world = verdict.worst
                repeats = range(repeat, repeat + 1)
                (mission,) = (
                    mission
                    for mission in self.experiment.plan.stated(
                        index, design.design, worst.case, worst.number, repeats
                    )
                    if mission.world == world
                )
                verdicts = self.record.verdicts[index]
                verdicts[name] = replace(verdict, worst=(mission.trial, world))

    def _start(self, scenario: Scenario, index: int, design: NamedDesign) -> CaseSearch:
        plan = self.experiment.plan

        def try_cases(
            cases: Sequence[CaseTrials], repeats: range
        ) -> list[Mapping[str, list[Outcome]]]:
            missions = [
                plan.stated(index, design.design, trials.case, trials.number, repeats)
                for trials in cases
            ]
            needed = list(chain.from_iterable(missions))
            self.status.display.begin(0, len(needed), sum(map(self.record.has, needed)))
            self.dispatcher.run_missing(scenario, needed, self.record, self.status.mission)
            return [self._sort_by_world(of_case) for of_case in missions]

        sensors, worlds = len(design.design.mounts), len(self.experiment.world)
        rng = generator(f"{self.experiment.seed}/worst_cases/{index}", "search")
        return CaseSearch(self.settings, sensors, worlds, try_cases, rng)

    def _sort_by_world(self, missions: Sequence[Mission]) -> Mapping[str, list[Outcome]]:
        outcomes: dict[str, list[Outcome]] = {}
        for mission in missions:
            outcomes.setdefault(mission.world, []).append(judge(self.record.find_stated(mission)))
        return outcomes

    def _describe_model(self, index: int, design: NamedDesign) -> list[list[object]]:
        """Return the rows of the trials under the failure model, one for each world."""
        trials = self.experiment.trials
        rows: list[list[object]] = []
        for world, rate in self.record.rates(index).items():
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
        stopped, failed = search.list_stopped(trials), len(trials.case.sensors)
        key = (design.source, design.name, trials.number, trials.case.text, failed, trials.stage)
        confidence = self.settings.confidence
        rows: list[list[object]] = []
        for world in trials.outcomes:
            completed, count = trials.count(world)
            rates = (completed / count, *bound_rate(completed, count, confidence), confidence)
            findings = (world in stopped, smallest, failed in search.whole)
            rows.append([*key, world, count, completed, *rates, *findings])
        return rows


def state_failures(experiment: Experiment) -> Scenario:
    """Return the scenario of stated cases, in which only the sensors of a case fail."""
    assert experiment.worst_cases is not None
    failure = GivenFailure(effect=experiment.worst_cases.effect)
    return replace(experiment.scenario, failure=failure)
