"""The folder of an evaluation while it is open: its missions, and the scores of its designs."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

from evoros.dispatch.record import MissionResult
from evoros.evolution.experiment import ALL, Experiment
from evoros.fitness.scoring import FITNESS, FITNESS_MEAN
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import Outcomes
from evoros.requirement.claim import Claim
from evoros.requirement.verdict import Verdict
from evoros.session.design_tables import NamedDesign
from evoros.session.design_trials import ROUND, DesignTrials, make_judge
from evoros.session.requirement_table import write_verdicts
from evoros.session.status import log_repair
from evoros.storage.layout import MISSIONS, SCORES
from evoros.storage.mission_log import MissionLog
from evoros.storage.tables import (
    CASE,
    case_cells,
    list_further_in,
    name_outcome_columns,
    outcome_cells,
    read_conditions,
    read_outcomes,
    to_csv,
)

KEY_COLUMNS = ("source", "design", "world", "trial", "draws")
UNKNOWN = -1
"""The index of a design that the evaluation does not have."""
GENERATION = 0
"""All designs meet the draws of this generation of evaluations; another seed gives others."""


def evaluation_header(experiment: Experiment) -> list[str]:
    """Return the columns of the table of missions."""
    case = [CASE] if experiment.states_cases else []
    columns = name_outcome_columns(experiment.agents, list_further_in(experiment.scenario))
    return [*KEY_COLUMNS, *columns, *case]


class EvaluationRecord(MissionLog):
    """An open folder of an evaluation. It keeps outcomes of unfinished designs only.

    Designs are known by their index in the given order.

    Raises:
        InputError: the missions on disk do not belong to this evaluation.
    """

    def __init__(self, path: Path, experiment: Experiment, designs: Sequence[NamedDesign]) -> None:
        super().__init__(path, evaluation_header(experiment), log_repair)
        self._experiment, self._designs = experiment, designs
        self._indices = {(design.source, design.name): i for i, design in enumerate(designs)}
        self._further = list_further_in(experiment.scenario)
        self._keeps_all = experiment.record == ALL
        trials = experiment.plan.evaluation_trials
        claims = any(isinstance(one, Claim) for one in experiment.requirements.values())
        first = min(ROUND, trials) if claims else trials
        self._first_missions = first * len(experiment.world)  # of a design that has not begun
        self._unfinished: dict[int, DesignTrials] = {}
        self._counts: dict[int, int] = {}  # of the missions of finished designs
        self._scores: dict[int, dict[str, float]] = {}  # of finished designs
        self.verdicts: dict[int, dict[str, Verdict]] = {}  # of finished designs
        self._stated: dict[MissionKey, tuple[str, Outcomes]] = {}  # conditions and outcomes
        self._unwanted: set[MissionKey] = set()  # of these, until they are asked for
        try:
            self._read()
        except BaseException:
            self.close()
            raise

    @property
    def wanted(self) -> int:
        """The number of missions of the evaluation."""
        begun = sum(design.wanted for design in self._unfinished.values())
        others = len(self._designs) - len(self._counts) - len(self._unfinished)
        of_designs = sum(self._counts.values()) + begun + others * self._first_missions
        return of_designs + len(self._stated)

    @property
    def known(self) -> int:
        """The number of missions on disk."""
        unfinished = sum(len(design.outcomes) for design in self._unfinished.values())
        return sum(self._counts.values()) + unfinished + len(self._stated)

    def list_missions(self) -> Iterator[Mission]:
        """Yield the missions that unfinished designs need so far, including those on disk."""
        for index in range(len(self._designs)):
            if index not in self._scores:
                yield from self._start(index).list_wanted()

    def has(self, mission: Mission) -> bool:
        """Whether the mission is on disk."""
        if mission.case is not None:
            return self._find_stated(mission) is not None
        index = mission.design_id
        return index in self._scores or mission.key in self._start(index).outcomes

    def find_stated(self, mission: Mission) -> Outcomes:
        """Return the outcomes of a mission of a stated case, which is on disk."""
        outcomes = self._find_stated(mission)
        assert outcomes is not None
        return outcomes

    def _find_stated(self, mission: Mission) -> Outcomes | None:
        row = self._stated.get(mission.key)
        if row is None or (self._keeps_all and not self.trajectories.has(mission)):
            return None
        conditions, outcomes = row
        self.require_conditions(mission, conditions)
        self._unwanted.discard(mission.key)
        return outcomes

    def record(self, results: Sequence[MissionResult]) -> None:
        """Put finished missions on disk."""
        new = [result for result in results if result[0].key not in self._stated]
        self.append([self._row(*result) for result in new])
        for result in results:
            self._take(*result)

    def rates(self, index: int) -> dict[str, float]:
        """Return the share of the trials in which a finished design completed each world."""
        scores = self._scores[index]
        return {world: scores[f"{world}_completed"] for world in self._experiment.world}

    def write_scores(self) -> None:
        """Write the scores and the verdicts on requirements once all designs are finished."""
        self.table.sync()
        columns = self._experiment.scoring.name_columns(list(self._experiment.world))
        rows: list[Sequence[object]] = [("source", "design", *columns)]
        for index, design in enumerate(self._designs):
            rows.append([design.source, design.name, *self._scores[index].values()])
        self.write_once(SCORES, to_csv(rows))
        requirements = self._experiment.requirements
        if requirements:
            files = write_verdicts(self._designs, requirements, self.verdicts)
            for name, content in files.items():
                self.write_once(name, content)

    def complete(self) -> None:
        """Put the rows of missions into the order of design, as given, world and trial."""
        ranks = {world: rank for rank, world in enumerate(sorted(self._experiment.world))}

        def order(row: Mapping[str, str]) -> tuple[int, ...]:
            index = self._indices[row["source"], row["design"]]
            return index, ranks[row["world"]], int(row["trial"])

        self.finish(order, set(self._find_unwanted()) if self._unwanted else ())

    def describe(self) -> dict[str, Any]:
        """Return the fields of ``status.json`` that only an evaluation has."""
        fitness = [row.get(FITNESS, row[FITNESS_MEAN]) for row in self._scores.values()]
        return {
            "designs": len(self._designs),
            "designs_done": len(self._scores),
            "best_fitness": max(fitness, default=None),
            "mean_fitness": fmean(fitness) if fitness else None,
            "missions_wanted": self.wanted,
            "missions": self.known,
        }

    def _find_unwanted(self) -> Iterator[int]:
        """Yield the places of the rows for which no search and no requirement has asked."""
        for key, *_ in self.table.read(self._parse):
            if key in self._unwanted:
                yield self.table.place

    def _parse(self, row: Mapping[str, str]) -> tuple[MissionKey, str, bool, Outcomes]:
        index = self._indices.get((row["source"], row["design"]), UNKNOWN)
        outcomes = read_outcomes(row, list(self._experiment.agents))
        key = (GENERATION, index, row["world"], int(row["trial"]))
        return key, read_conditions(row), bool(row.get(CASE)), outcomes

    def _read(self) -> None:
        for key, draws, stated, outcomes in self.table.read(self._parse):
            _, index, world, trial = key
            if stated:
                if key in self._stated or index == UNKNOWN:
                    self.table.reject()
                    continue
                self._stated[key] = (draws, outcomes)
                self._unwanted.add(key)
                continue
            mission = self._find_missing(key)
            if mission is None or (self._keeps_all and not self.trajectories.has(mission)):
                self.table.reject()
                continue
            if mission.draws != draws:
                raise self.refuse(
                    MISSIONS,
                    f"trial {trial} of design {self._designs[index].name!r} in {world} must be "
                    f"one of the evaluation's under its draws, not {draws}",
                )
            self._take(mission, outcomes)

    def _find_missing(self, key: MissionKey) -> Mission | None:
        """Find the mission of the evaluation with a key, unless its outcome is known."""
        index = key[1]
        if index == UNKNOWN or index in self._scores:
            return None
        design = self._start(index)
        return None if key in design.outcomes else design.missions.get(key)

    def _start(self, index: int) -> DesignTrials:
        if index not in self._unfinished:
            design, experiment = self._designs[index].design, self._experiment
            missions = experiment.plan.evaluation(GENERATION, index, design)
            by_key, judge = {m.key: m for m in missions}, make_judge(experiment, design)
            self._unfinished[index] = DesignTrials(by_key, len(experiment.world), judge)
        return self._unfinished[index]

    def _take(self, mission: Mission, outcomes: Outcomes) -> None:
        """Score a design once all its missions are known, and drop its outcomes."""
        if mission.case is not None:
            self._stated[mission.key] = mission.conditions, outcomes
            return
        index = mission.design_id
        design = self._start(index)
        design.take(mission.key, outcomes)
        if design.finished:
            missions = design.list_wanted()
            self._scores[index] = self._experiment.scoring.summarize(missions, design.outcomes)
            self._counts[index], self.verdicts[index] = len(missions), dict(design.verdicts)
            self._unwanted |= design.outcomes.keys() - {mission.key for mission in missions}
            del self._unfinished[index]

    def _row(self, mission: Mission, outcomes: Outcomes) -> list[object]:
        design = self._designs[mission.design_id]
        key = (design.source, design.name, mission.world, mission.trial, mission.draws)
        case = case_cells(mission, self._experiment.states_cases)
        return [*key, *outcome_cells(outcomes, self._further), *case]
