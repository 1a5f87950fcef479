"""Evaluations of given designs: creates a new one, opens a recorded one, and runs either."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from logging import LogRecord
from pathlib import Path
from typing import Any

from evoros.base.checks import TEXT
from evoros.base.errors import InputError
from evoros.config.configuration import Configuration
from evoros.dispatch.dispatcher import Dispatcher
from evoros.evolution.experiment import ALL, Experiment
from evoros.executor.protocol import Executor, Pool
from evoros.mission.plan import VALIDATION
from evoros.mission.scenario import Scenario
from evoros.preflight.drive import report_drive
from evoros.preflight.preflight import preflight
from evoros.preflight.repeatability import report_repeatability
from evoros.preflight.sight import check_designs
from evoros.session.design_tables import NamedDesign, read_recorded_designs, write_designs
from evoros.session.evaluation_record import EvaluationRecord, evaluation_header
from evoros.session.figures import PAGE, Draw, draw_figures
from evoros.session.given_designs import read_given
from evoros.session.like import warn_of_changes
from evoros.session.resume import ORIGINALS_OF, rebuild
from evoros.session.status import Display, Status, log_start
from evoros.session.work import PoolOpener, open_pool
from evoros.session.worst_case_run import WorstCaseRun
from evoros.session.worst_missions import keep_worst
from evoros.storage.creation import create_folder, require_unused
from evoros.storage.figure_context import describe_experiment
from evoros.storage.layout import (
    CONFIG,
    CONFIG_DIR,
    EVALUATE,
    FINISHED,
    MANIFEST,
    MISSIONS,
    OVERRIDES,
    SETTING,
)
from evoros.storage.manifest import manifest
from evoros.storage.mission_table import begin_table
from evoros.storage.seals import seal_json
from evoros.terminal.log import LOGGER, collect_messages

MAX_WARNINGS = 3  # about given designs
FIGURE = "worst"  # of an evaluation that looked for worst cases


@dataclass(frozen=True)
class Evaluation:
    """An evaluation that is built and recorded."""

    experiment: Experiment
    designs: Sequence[NamedDesign]
    path: Path
    messages: Sequence[LogRecord]  # logged while it was built

    @property
    def executor(self) -> Executor:
        """Computes the missions."""
        return self.experiment.executor

    def run(self, display: Display, draw: Draw, opener: PoolOpener = open_pool) -> None:
        """Run the missions that are missing and write the table of scores.

        Raises:
            InputError: the missions on disk do not belong to this evaluation.
            RunStopped: a mission was lost; the evaluation can be resumed.
        """
        with EvaluationRecord(self.path, self.experiment, self.designs) as record:
            status = Status(record, display, record.describe)
            with status.track(self.messages):
                record.mend(describe_experiment(self.experiment).text, ORIGINALS_OF[EVALUATE])
                display.start(1)
                display.begin(0, record.wanted, record.known)
                with opener(self.executor) as pool:
                    self._run_missions(record, status, pool)
                    record.complete()
                    if self._figures:
                        status.write(FINISHED)  # first: figures are drawn of finished folders
                        draw_figures(self.path, self._figures, pool, draw)

    @property
    def _figures(self) -> list[str]:
        """The figures of what the evaluation looks for."""
        worst = [FIGURE] if self.experiment.worst_cases is not None else []
        return [*worst, PAGE] if self.experiment.requirements else worst

    def _run_missions(self, record: EvaluationRecord, status: Status, pool: Pool) -> None:
        experiment = self.experiment
        scenario = experiment.scenario_for(experiment.evaluation_draws)
        amount = f"{len(self.designs)} designs, {experiment.plan.evaluation_trials} trials"
        log_start(self.path, amount, experiment, pool)
        report_drive(experiment, pool)
        if not record.known:
            report_repeatability(scenario, next(record.list_missions()), pool)
        keep = record.keep_trajectory if experiment.record == ALL else None
        dispatcher = Dispatcher(pool, experiment.lost_missions, record.keep_log, keep)
        while record.known < record.wanted:  # requirements ask for more, round by round
            wanted = record.wanted
            dispatcher.run_missing(scenario, record.list_missions(), record, status.mission)
            status.display.begin(0, record.wanted - wanted, 0)
        if experiment.worst_cases is not None:
            settings, designs = experiment.worst_cases, self.designs
            WorstCaseRun(experiment, settings, designs, record, dispatcher, status).run()
        record.write_scores()
        keep_worst(record, experiment, self.designs, dispatcher)


def create_evaluation(config: Configuration, folder: Path) -> Evaluation:
    """Build an evaluation of the designs that the configuration names; record it in a new folder.

    Raises:
        InputError: something cannot be used; the folder is unchanged.
    """
    require_unused(folder)
    with collect_messages() as messages:
        _check_sources(config.designs)
        if any(text.lstrip("+~").startswith("observers") for text in config.overrides):
            raise InputError("observers: must not be typed for an evaluation; observe a run")
        experiment = config.build()
        _check_draws(experiment)
        preflight(experiment)
        warn_of_changes(config, experiment)
        designs = read_sources(config.designs, experiment)
        evaluation = record_evaluation(experiment, designs, config, folder, messages)
        for warning in _check_designs(designs, experiment.scenario):
            LOGGER.warning("%s", warning)
        return evaluation


def _check_designs(designs: Sequence[NamedDesign], scenario: Scenario) -> Iterator[str]:
    """Yield the warnings of the first few designs that have any, and the number of the others."""
    robots = {
        f"{member.name}: design {named.name} of {named.source}".removeprefix(": "): member.robot
        for named in designs
        for member in scenario.equip(named.design)
    }
    warnings = list(check_designs(robots))
    yield from warnings[:MAX_WARNINGS]
    if len(warnings) > MAX_WARNINGS:
        yield f"{len(warnings) - MAX_WARNINGS} more designs overlap or see the robot likewise"


def record_evaluation(
    experiment: Experiment,
    designs: Sequence[NamedDesign],
    config: Configuration,
    folder: Path,
    messages: Sequence[LogRecord],
) -> Evaluation:
    """Record an evaluation of designs in a new folder.

    Raises:
        InputError: the folder cannot be made; it is unchanged.
    """
    files = write_designs(designs)
    content = manifest(experiment, config.text, config.values, config.choices, EVALUATE, files)
    content[CONFIG_DIR] = config.config_dir
    content[OVERRIDES] = list(config.overrides)
    first = {CONFIG: config.text, MANIFEST: seal_json(MANIFEST, content)}
    setting = {SETTING: describe_experiment(experiment).text}
    table = {MISSIONS: begin_table(evaluation_header(experiment))}
    create_folder(folder, {**first, **setting, **files, **table})
    return Evaluation(experiment, designs, folder, messages)


def open_evaluation(
    folder: Path, overrides: Sequence[str], config_dir: str | Path | None
) -> Evaluation:
    """Open the evaluation in a folder to resume it; running a finished one verifies it.

    ``overrides`` may change the executor; ``config_dir`` has the modules of the user's own parts.

    Raises:
        InputError: the folder has no evaluation, another override, or something that the
            evaluation is made of has changed.
    """
    with collect_messages() as messages:
        experiment = rebuild(folder, overrides, config_dir, EVALUATE).experiment
        preflight(experiment)
        designs = read_recorded_designs(folder, experiment)
    return Evaluation(experiment, designs, folder, messages)


def read_sources(sources: Any, experiment: Experiment) -> list[NamedDesign]:
    """Read the designs that the key ``designs`` names.

    Raises:
        InputError: it names nothing, or something that cannot be read.
    """
    return read_given(_check_sources(sources), experiment)


def _check_draws(experiment: Experiment) -> None:
    """Require that an evaluation under the draws of a validation has trials, and no other draws."""
    if experiment.evaluation_draws != VALIDATION:
        return
    if not experiment.plan.evaluation_trials:
        raise InputError(
            "optimizer.validation_trials: must be at least 1 with evaluation_draws=validation, "
            "not 0; repeat the value of the run"
        )
    if experiment.worst_cases is not None:
        raise InputError(
            "worst_cases: must be none with evaluation_draws=validation, because the search has "
            "draws of its own; leave out one of the two"
        )


def _check_sources(designs: Any) -> list[str]:
    """Return the sources that the key ``designs`` names."""
    sources = designs if isinstance(designs, list) else [designs]
    if not sources or not all(TEXT.holds(source) for source in sources):
        raise InputError(
            f"designs: must be a CSV file, the folder of a finished run or of a sweep, or a list "
            f"of these, not {'null' if designs is None else designs}; add designs=FILE.csv"
        )
    return sources
