"""The evaluation of given designs: started, resumed, its folder. ``evoros-evaluate`` is this."""

import json
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from logging import LogRecord
from pathlib import Path
from statistics import fmean
from typing import Any

from evoros.base.checks import TEXT
from evoros.base.errors import InputError
from evoros.base.log import LOGGER, collect_messages
from evoros.config.configuration import Configuration
from evoros.evolution.dispatch import Dispatcher, MissionResult
from evoros.evolution.experiment import Experiment
from evoros.executor.protocol import Executor, Pool
from evoros.fitness.scoring import score_columns, scores
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.outcome import Outcome
from evoros.session.given_designs import (
    DESIGN_FILE,
    GENE_FILE,
    NamedDesign,
    read_given,
    read_kept,
    to_files,
)
from evoros.session.resume import rebuild
from evoros.session.run import check_experiment
from evoros.session.status import RUNNING, Display, Tally, recording
from evoros.session.work import PoolOpener, open_pool
from evoros.storage.figure_context import SETTING, describe_experiment
from evoros.storage.manifest import manifest
from evoros.storage.mission_log import (
    CONFIG,
    MANIFEST,
    MISSIONS,
    MissionLog,
    create_folder,
    require_unused,
)
from evoros.storage.tables import OUTCOME_COLUMNS, outcome_cells, read_outcome, to_csv

COMMAND = "evoros-evaluate"
DESIGNS = "designs.csv"
HEADER = ("source", "design", "world", "trial", "draws", *OUTCOME_COLUMNS)
GENERATION = 0
"""All designs meet the draws of one generation of evaluations; another seed gives others."""
STATUS_S = 5.0
"""Wall clock between two updates of ``status.json``."""


@dataclass(frozen=True)
class Evaluation:
    """An evaluation that can begin or go on: it is built, and its folder is there."""

    experiment: Experiment
    given: Sequence[NamedDesign]
    path: Path
    said: Sequence[LogRecord]  # while it was built

    @property
    def executor(self) -> Executor:
        """Where its missions are to be computed."""
        return self.experiment.executor

    def run(self, display: Display, opener: PoolOpener = open_pool) -> None:
        """To its end.

        Raises:
            InputError: the missions on disk are not its own.
            RunStopped: a mission was lost; the evaluation can be resumed.
        """
        experiment, given = self.experiment, self.given
        with MissionLog(self.path, HEADER) as folder:
            assessment = _Evaluator(experiment, given, folder, display)
            assessment.read()
            with recording(self.path, self.said, assessment.write_status):
                LOGGER.info(
                    "%s: %d designs, %d trials, seed %d, worlds %s, %d workers",
                    self.path,
                    len(given),
                    experiment.trials,
                    experiment.seed,
                    ", ".join(experiment.world),
                    self.executor.workers,
                )
                with opener(self.executor) as pool:
                    assessment.run(pool)


def create_evaluation(config: Configuration, folder: Path) -> Evaluation:
    """That of the designs that the configuration names, in a new folder.

    Raises:
        InputError: something cannot be used; the folder is then as it was.
    """
    require_unused(folder)
    with collect_messages() as said:
        sources = _check_sources(config.designs)
        experiment = config.build()
        check_experiment(experiment)
        given = read_given(sources, experiment.scenario)
        files = to_files(given)
        described = manifest(experiment, config.text, config.values, config.choices, COMMAND, files)
    about = {
        MANIFEST: json.dumps(described, indent=2) + "\n",
        SETTING: describe_experiment(experiment).text,
    }
    first = {CONFIG: config.text, **about, **files}
    create_folder(folder, {**first, MISSIONS: to_csv([HEADER])})
    return Evaluation(experiment, given, folder, said)


def open_evaluation(
    folder: Path, overrides: Sequence[str], config_dir: str | Path | None
) -> Evaluation:
    """The evaluation in the folder, to go on; a finished one is verified.

    ``overrides`` may change the executor; ``config_dir`` has the modules of the user's own parts.

    Raises:
        InputError: no evaluation there, another override, or what it is made of has changed.
    """
    with collect_messages() as said:
        files = (DESIGN_FILE, GENE_FILE)
        experiment, _ = rebuild(folder, overrides, config_dir, COMMAND, files)
        check_experiment(experiment)
        given = read_kept(folder, experiment.scenario)
    return Evaluation(experiment, given, folder, said)


def _check_sources(designs: Any) -> list[str]:
    """The sources that the key ``designs`` names.

    Raises:
        InputError: it names nothing, or something other than texts.
    """
    sources = designs if isinstance(designs, list) else [designs]
    if not sources or not all(TEXT.holds(source) for source in sources):
        raise InputError(
            f"designs: must be a CSV file, the folder of a finished run or of a sweep, or a list "
            f"of these, not {'null' if designs is None else designs}; add designs=FILE.csv"
        )
    return sources


@dataclass
class _UnfinishedDesign:
    """A design of which some missions were flown."""

    missions: dict[MissionKey, Mission]
    outcomes: dict[MissionKey, Outcome] = field(default_factory=dict)


@dataclass
class _Evaluator:
    """An evaluation in progress. Designs are numbered as given."""

    experiment: Experiment
    given: Sequence[NamedDesign]
    folder: MissionLog
    display: Display
    tally: Tally = field(default_factory=lambda: Tally(time.monotonic()))
    partial: dict[int, _UnfinishedDesign] = field(default_factory=dict)
    rows: dict[int, dict[str, float]] = field(default_factory=dict)  # of designs that are done
    written: float = 0.0  # when the status was written, of time.monotonic

    def read(self) -> None:
        """Take what is on disk."""
        numbers = {(one.source, one.name): number for number, one in enumerate(self.given)}

        def parse(row: Mapping[str, str]) -> tuple[int, str, int, str, Outcome]:
            number = numbers[row["source"], row["design"]]
            return number, row["world"], int(row["trial"]), row["draws"], read_outcome(row)

        for number, world, trial, draws, outcome in self.folder.read(parse):
            if number in self.rows:
                continue
            mission = self._begun(number).missions.get((GENERATION, number, world, trial))
            if mission is None or mission.draws != draws:
                raise InputError(
                    f"{self.folder.path / MISSIONS}: trial {trial} of design "
                    f"{self.given[number].name!r} in {world} must be one of the evaluation's under "
                    f"its draws, not {draws}: the file was made by another version or has been "
                    f"edited; start a new evaluation"
                )
            self._take(mission, outcome)

    def run(self, pool: Pool) -> None:
        """Fly what is missing, and write the table of the designs."""
        experiment = self.experiment
        self.display.start(1)
        self.display.begin(0, self.wanted, self.known)
        dispatcher = Dispatcher(pool, experiment.executor.workers, experiment.lost_missions)
        dispatcher.run_missing(experiment.scenario, self._missions(), self, self._notify)
        self.folder.sync()
        columns = score_columns(list(experiment.world))
        table: list[Sequence[object]] = [("source", "design", *columns)]
        for number, one in enumerate(self.given):
            table.append([one.source, one.name, *self.rows[number].values()])
        self.folder.write_once(DESIGNS, to_csv(table))

    @property
    def wanted(self) -> int:
        """All missions of the evaluation."""
        return len(self.given) * len(self.experiment.world) * self.experiment.trials

    @property
    def known(self) -> int:
        """The missions that are on disk."""
        each = len(self.experiment.world) * self.experiment.trials
        return len(self.rows) * each + sum(len(some.outcomes) for some in self.partial.values())

    def write_status(self, state: str, reason: str = "") -> None:
        """How far the evaluation is."""
        self.written = time.monotonic()
        means = [row["fitness_mean"] for row in self.rows.values()]
        status = {
            "state": state,
            "reason": reason,
            "designs": len(self.given),
            "designs_done": len(self.rows),
            "best_fitness": max(means, default=None),
            "mean_fitness": fmean(means) if means else None,
            "missions_wanted": self.wanted,
            "missions": self.known,
        }
        self.folder.write_status(status | self.tally.figures)

    def _begun(self, number: int) -> _UnfinishedDesign:
        if number not in self.partial:
            plan, design = self.experiment.plan, self.given[number].design
            missions = plan.evaluation(GENERATION, number, design)
            self.partial[number] = _UnfinishedDesign({mission.key: mission for mission in missions})
        return self.partial[number]

    def has(self, mission: Mission) -> bool:
        """Whether the mission is on disk."""
        number = mission.design_id
        return number in self.rows or mission.key in self._begun(number).outcomes

    def record(self, results: Sequence[MissionResult]) -> None:
        """Put finished missions on disk."""
        self.folder.append([self._row(mission, outcome) for mission, outcome in results])
        for mission, outcome in results:
            self._take(mission, outcome)

    def _missions(self) -> Iterator[Mission]:
        """All missions of the designs that are not done."""
        for number in range(len(self.given)):
            if number not in self.rows:
                yield from self._begun(number).missions.values()

    def _row(self, mission: Mission, outcome: Outcome) -> list[object]:
        one = self.given[mission.design_id]
        place = (one.source, one.name, mission.world, mission.trial, mission.draws)
        return [*place, *outcome_cells(outcome)]

    def _notify(self, mission: Mission, outcome: Outcome) -> None:
        """Report a mission that is on disk."""
        self.tally.count(mission, outcome)
        self.display.mission(mission, outcome)
        if time.monotonic() - self.written > STATUS_S:
            self.write_status(RUNNING)

    def _take(self, mission: Mission, outcome: Outcome) -> None:
        """Of a design whose missions are all flown, nothing is kept but its row."""
        some = self._begun(mission.design_id)
        some.outcomes[mission.key] = outcome
        if len(some.outcomes) == len(some.missions):
            missions = list(some.missions.values())
            self.rows[mission.design_id] = scores(self.experiment.fitness, missions, some.outcomes)
            del self.partial[mission.design_id]
