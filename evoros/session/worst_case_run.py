"""The search for worst cases of given designs, and the worst mission for each unmet requirement."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from evoros.base.arrays import Array
from evoros.base.rng import generator
from evoros.certificate.rates import bound_rate
from evoros.dispatch.dispatcher import Dispatcher
from evoros.evolution.experiment import NONE, STATED, Experiment
from evoros.failure.protocol import MODEL
from evoros.mission.mission import NOT_RUN, Mission, MissionKey, Outcome, Outcomes, judge
from evoros.mission.scenario import Scenario
from evoros.requirement.verdict import MET
from evoros.session.design_tables import NamedDesign
from evoros.session.rebuilding import plan_row
from evoros.session.status import Status
from evoros.storage.layout import MISSIONS, WORST_CASES, read_rows
from evoros.storage.run_folder import RunFolder
from evoros.storage.tables import are_recorded, to_csv
from evoros.storage.verdicts import Row, name_worst, read_verdicts
from evoros.terminal.activity import announce
from evoros.terminal.log import LOGGER
from evoros.worst_cases.worst_cases import CaseSearch, CaseTrials, WorstCases

COLUMNS = (
    *("source", "design", "number", "case", "failed", "stage", "world", "trials", "completed"),
    *("rate", "low", "high", "confidence", "stops", "smallest", "all_sets"),
)


@dataclass(frozen=True)
class WorstCaseRun:
    """The search for worst cases in an evaluation that has an open folder."""

    experiment: Experiment
    settings: WorstCases
    designs: Sequence[NamedDesign]
    rates: Sequence[Mapping[str, float]]  # fraction of completed trials per design, by world
    conditions: Sequence[int]  # number per design; worst cases are numbered from here
    folder: RunFolder
    dispatcher: Dispatcher
    status: Status

    def run(self) -> None:
        """Search for the worst cases, and write them; recorded outcomes make resuming exact."""
        scenario = self.experiment.scenario_under(STATED)
        rows: list[Sequence[object]] = [COLUMNS]
        for index, design in enumerate(self.designs):
            search = self._start(scenario, index, design)
            with announce("looking for worst cases"):
                stopping = search.run()
            rows += self._describe_model(index, design)
            for trials in (search.nominal, *search.tried.values()):
                rows += self._describe(design, search, trials, trials in stopping)
        self.folder.write_once(WORST_CASES, to_csv(rows))

    def _start(self, scenario: Scenario, index: int, design: NamedDesign) -> CaseSearch:
        plan, first, folder = self.experiment.plan, self.conditions[index], self.folder

        def try_cases(
            cases: Sequence[CaseTrials], repeats: range
        ) -> list[Mapping[str, list[Outcome]]]:
            missions = [
                plan.stated(index, design.design, first + trials.number, repeats, trials.case)
                for trials in cases
            ]
            needed = list(chain.from_iterable(missions))
            self.status.display.begin(0, len(needed), sum(map(folder.has, needed)))
            self.dispatcher.run_missing(scenario, needed, folder, self.status.mission)
            return [self._sort_by_world(of_case) for of_case in missions]

        sensors, worlds = len(design.design.mounts), len(self.experiment.world)
        rng = generator(f"{self.experiment.seed}/worst_cases/{index}", "search")
        return CaseSearch(self.settings, sensors, worlds, try_cases, rng)

    def _sort_by_world(self, missions: Sequence[Mission]) -> Mapping[str, list[Outcome]]:
        outcomes: dict[str, list[Outcome]] = {}
        for mission in missions:
            recorded = self.folder.find(mission)
            assert recorded is not None, "the mission has been run"
            outcomes.setdefault(mission.world, []).append(judge(recorded))
        return outcomes

    def _describe_model(self, index: int, design: NamedDesign) -> list[list[object]]:
        trials = self.experiment.plan.evaluation_trials
        rows: list[list[object]] = []
        for world, rate in self.rates[index].items():
            completed = round(rate * trials)
            bounds = bound_rate(completed, trials, self.settings.confidence)
            counts = (world, trials, completed, rate, *bounds, self.settings.confidence)
            key = (design.source, design.name, 0, "", math.nan, MODEL)
            rows.append([*key, *counts, False, False, False])
        return rows

    def _describe(
        self, design: NamedDesign, search: CaseSearch, trials: CaseTrials, smallest: bool
    ) -> list[list[object]]:
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


Missing = dict[MissionKey, tuple[Mission, Outcomes]]  # missions without stored trajectory


def keep_worst(
    folder: RunFolder,
    experiment: Experiment,
    designs: Sequence[NamedDesign],
    dispatcher: Dispatcher,
) -> None:
    """Store the trajectory of the worst mission for each unmet requirement."""
    if experiment.record == NONE:
        return
    by_id = {index: named.design for index, named in enumerate(designs)}
    keyed = [(folder.read_mission(row)[0], row) for row in _list_worst(folder)]
    worst = [plan_row(experiment, by_id, key, row) for key, row in keyed]
    if not folder.keeps_all:  # extending an evaluation may change which missions are worst
        folder.drop_trajectories([mission for mission, _ in worst])
    missing: dict[Scenario, Missing] = {}
    for mission, scenario in worst:
        outcomes = folder.find(mission)
        assert outcomes is not None, "the mission has a row"
        if judge(outcomes).ended not in NOT_RUN and not folder.trajectories.has(mission):
            missing.setdefault(scenario, {})[mission.key] = mission, outcomes
    for scenario, of_scenario in missing.items():
        _run_again(folder, scenario, of_scenario, dispatcher, list(experiment.agents))


def _list_worst(folder: RunFolder) -> list[Row]:
    verdicts = [row for row in read_verdicts(folder.path) if row["result"] != MET]
    wanted = {tuple(name_worst(row).values()) for row in verdicts}
    if not wanted:
        return []
    columns = list(name_worst(verdicts[0]))
    rows = read_rows(folder.path / MISSIONS)
    return [row for row in rows if tuple(row[name] for name in columns) in wanted]


def _run_again(
    folder: RunFolder,
    scenario: Scenario,
    missions: Missing,
    dispatcher: Dispatcher,
    agents: Sequence[str],
) -> None:
    tracks: dict[MissionKey, Array] = {}

    def keep(scenario: Scenario, mission: Mission, trajectory: Array) -> None:
        tracks[mission.key] = trajectory

    again = replace(dispatcher, keep_trajectory=keep)
    for results in again.run(scenario, [mission for mission, _ in missions.values()]):
        for mission, outcomes in results:
            if are_recorded(outcomes, missions[mission.key][1], agents):
                folder.keep_trajectory(scenario, mission, tracks[mission.key])
            else:
                LOGGER.warning(
                    "%s: trial %d of design %d in %s had a different outcome when rerun; its "
                    "trajectory is not kept",
                    *(folder.path, mission.trial, mission.design_id, mission.world),
                )
