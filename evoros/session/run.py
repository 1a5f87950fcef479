"""Creates, opens and executes runs, which are searches or evaluations."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from logging import LogRecord
from pathlib import Path

from evoros.base.errors import InputError, write_count
from evoros.base.rng import generator
from evoros.config.configuration import Configuration
from evoros.config.recorded import find_difference, read_recorded
from evoros.evolution.experiment import Experiment
from evoros.evolution.stop_after import StopAfter
from evoros.executor.protocol import Executor
from evoros.files.disk import require_no_links
from evoros.mission import plan
from evoros.preflight.drive import report_drive
from evoros.preflight.own_code import report_repeatability
from evoros.preflight.preflight import preflight
from evoros.robot.second_reading import report_second_reading
from evoros.session import work
from evoros.session.design_tables import NamedDesign, read_recorded_designs, write_designs
from evoros.session.evaluation import Evaluation, build_evaluation, list_faults, read_sources
from evoros.session.observation import observe
from evoros.session.rebuilding import rebuild
from evoros.session.search import Search, build_search
from evoros.session.status import Display, Status, log_repair, survey
from evoros.storage import layout
from evoros.storage.creation import require_unused
from evoros.storage.digests import read_original
from evoros.storage.figure_context import describe_experiment
from evoros.storage.layout import read_bytes, read_sealed
from evoros.storage.manifest import list_unrecorded, manifest, record_modules
from evoros.storage.run_folder import RunFolder
from evoros.storage.verification import find_strays, is_complete, verify_folder
from evoros.terminal.log import LOGGER, collect_messages

SEARCH = (  # keys that affect only the search, and not the checks of robots or worlds
    *("seed", "trials", "draws", "optimizer", "allocation", "validation", "final_choice"),
    *("lost_missions", "record", "figures", "treatment"),
)
STOP_AFTER = "stop_after"
SIZES = {plan.GENERATIONS: "generations", plan.TRIALS: "trials", plan.VALIDATION_TRIALS: "trials"}
"""Keys whose values may be raised on resuming, and their fields in ``status.json``."""


@dataclass(frozen=True)
class Session:
    """A run that is built and recorded; its folder stays open until ``run`` ends."""

    task: Search | Evaluation
    messages: Sequence[LogRecord]  # messages logged while the run was built
    observed: bool = True  # True if observers receive the run's records

    @property
    def executor(self) -> Executor:
        """The executor for the run's missions."""
        return self.task.experiment.executor

    def run(
        self, display: Display, draw: work.DrawFigures, opener: work.PoolOpener = work.open_pool
    ) -> None:
        """Complete the run; ``draw`` draws the figures.

        Missions of a different run raise an InputError, a lost mission a RunStopped (resumable).
        """
        task, folder, experiment = self.task, self.task.folder, self.task.experiment
        outdated, status = self._is_outdated(), Status(folder, display, task.describe)
        is_search = isinstance(task, Search)
        observers = experiment.observers if is_search and self.observed else {}
        with folder, status.track(self.messages), observe(folder.path, observers) as tell:
            if isinstance(task, Search):
                task.tell = tell
            if outdated:
                work.discard_figures(
                    folder.path, work.list_figures(folder.path, experiment.figures)
                )
                folder.discard_results()
            folder.mend(describe_experiment(experiment).text)
            display.start(task.generations if isinstance(task, Search) else 1)
            with opener(self.executor) as pool:
                worlds = ", ".join(experiment.world)
                LOGGER.info(
                    "%s: %s, seed %d, worlds %s, %s",
                    *(folder.path, task.amount, experiment.seed, worlds),
                    write_count(pool.workers, "worker"),
                )
                report_second_reading(member.robot for member in experiment.members)
                report_drive(experiment, pool)
                if not len(folder.rows):
                    for scenario, mission in task.list_first():
                        report_repeatability(scenario, mission, pool)
                task.run(pool, status)
                reason = task.reason if isinstance(task, Search) else ""
                status.write(layout.FINISHED, reason)  # drawing a figure requires a finished run
                figures = work.list_figures(folder.path, experiment.figures)
                work.draw_figures(folder.path, figures, pool, draw)

    def _is_outdated(self) -> bool:
        ended, fields = self.task.folder.read_status(), self.task.describe()
        return (
            ended.get("state") != layout.FINISHED
            or bool(ended.get("reason"))
            or any(ended.get(name) != fields.get(name) for name in SIZES.values())
        )


def create_run(config: Configuration, folder: Path) -> Session:
    """Build and record a run in a new folder; after an InputError, the folder is unchanged."""
    require_unused(folder)  # checked first, because building takes seconds
    with collect_messages() as messages:
        if not config.evaluates:
            return record_run(build_search(config), config, folder, messages)
        experiment, designs = build_evaluation(config)
        session = record_run(experiment, config, folder, messages, designs=designs)
        for fault in list_faults(designs, experiment.scenario):
            LOGGER.warning("%s", fault)
        return session


def check_run(config: Configuration, similar: Experiment | None) -> Experiment:
    """Build and check a run without recording; reuse ``similar`` if only ``SEARCH`` keys differ."""
    if config.evaluates:
        return build_evaluation(config)[0]
    if similar is not None:
        with suppress(InputError):  # an error is reported when the whole run is built below
            experiment = config.rebuild(similar, SEARCH)
            rng = generator(f"{experiment.seed}", "optimizer")
            experiment.optimizer.start(similar.space, experiment.goals, rng)  # spaces are equal
            return experiment
    return build_search(config)


def record_run(
    experiment: Experiment,
    config: Configuration,
    folder: Path,
    messages: Sequence[LogRecord],
    size: int | None = None,
    designs: Sequence[NamedDesign] | None = None,
) -> Session:
    """Record a search, or an evaluation of ``designs``, with ``size`` generations or trials."""
    files, command = (
        ({}, layout.RUN) if designs is None else (write_designs(designs), layout.EVALUATE)
    )
    parts = config.text, config.values, config.choices
    content = manifest(experiment, *parts, command, files)
    content[layout.CONFIG_DIR], content[layout.SWEEP] = config.config_dir, config.sweep
    if designs is not None:
        content[layout.OVERRIDES] = list(config.overrides)
    setting = describe_experiment(experiment)
    record = RunFolder.create(folder, config.text, content, setting, files)
    if designs is None:
        search = Search(experiment, record, size or experiment.optimizer.generations)
        return Session(search, messages)
    return Session(_start_evaluation(record, experiment, designs, size), messages)


def open_run(
    folder: Path, overrides: Sequence[str] = (), config_dir: str | Path | None = None
) -> Session:
    """Open a run folder to resume the run; resuming a finished run verifies it.

    ``overrides`` may change the executor and the observers of a search, and raise the number of
    generations or trials. A finished search goes on only if they raise a limit. ``config_dir``
    holds the user's own parts.
    """
    with collect_messages() as messages:
        experiment, wanted, _ = rebuild(folder, overrides, config_dir, mends=True)
        preflight(experiment)
        record = RunFolder(folder, log_repair)
        record_modules(folder, list_unrecorded(folder))
        try:
            limited = any(word.startswith(STOP_AFTER) for word in overrides)
            task = _resume(record, experiment, wanted, limited)
        except BaseException:
            record.close()
            raise
    return Session(task, messages)


def _resume(
    record: RunFolder, experiment: Experiment, wanted: int | None, goes_on: bool
) -> Search | Evaluation:
    configured = read_recorded(record.path / layout.CONFIG).values
    if not layout.evaluates(record.path):
        for file in find_strays(record.path, record.digests.entries):
            LOGGER.warning("%s: ignored, because the run did not write this file", file)
        written = max(experiment.optimizer.generations, record.count_generations())
        size = _find_size(record, plan.GENERATIONS, written, wanted)
        status, limited = record.read_status(), experiment.stop_after != StopAfter()
        extended = limited or not status or bool(status.get("reason"))
        extended |= size != configured["optimizer"]["generations"]
        return Search(experiment, record, size, extended, not goes_on and wanted is None)
    key, written = plan.find_growing(configured), experiment.plan.evaluation_trials
    if key == plan.TRIALS and SIZES[key] not in record.read_status():
        written = max(written, record.rows.trials)
    designs = read_recorded_designs(record.path, experiment)
    return _start_evaluation(record, experiment, designs, _find_size(record, key, written, wanted))


def _start_evaluation(
    record: RunFolder, experiment: Experiment, designs: Sequence[NamedDesign], trials: int | None
) -> Evaluation:
    if trials not in (None, experiment.plan.evaluation_trials):
        if experiment.evaluation_draws == plan.VALIDATION:
            validation = replace(experiment.validation, trials=trials)
            experiment = replace(experiment, validation=validation)
        else:
            experiment = replace(experiment, trials=trials)
    return Evaluation(experiment, record, designs)


def _find_size(record: RunFolder, key: str, written: int, wanted: int | None) -> int:
    """Return the recorded number of generations or trials; ``wanted`` must not be smaller."""
    recorded = record.read_status().get(SIZES[key])
    known = max(recorded, written) if isinstance(recorded, int) else written
    if recorded is None and len(record.rows):  # a run without rows may have no status yet
        LOGGER.warning(
            "%s: missing or damaged; the run continues to %d %s, the number in %s or the tables; "
            "if you had extended the run further, give %s=... again",
            *(record.path / layout.STATUS, known, SIZES[key], layout.CONFIG, key),
        )
    if wanted is not None and wanted < known:
        raise InputError(
            f"{key}: must be at least {known} (the run already has {known}), not {wanted}; a run "
            f"can be extended but not shortened"
        )
    return known


def reopen_run(
    config: Configuration, folder: Path, overrides: Sequence[str], config_dir: str | None
) -> Session | None:
    """Open the run in a job's folder to resume it; return None if run and figures are complete."""
    require_same(folder, config)
    if config.evaluates:
        _require_same_designs(folder, config)
    figures = work.list_figures(folder, config.values.get("figures") or ())
    drawn = all(work.has_figure(folder, name) for name in figures)
    if survey(folder).state == layout.FINISHED and not _has_other_limits(folder, config):
        if drawn and not _is_damaged(folder):
            return None
        overrides = [word for word in overrides if not word.startswith(STOP_AFTER)]
    return open_run(folder, overrides, config_dir)


def _has_other_limits(folder: Path, config: Configuration) -> bool:
    """Return True if a limit ended the search and the job's limits have changed since."""
    recorded = read_recorded(folder / layout.CONFIG).values
    differ = recorded.get(STOP_AFTER) != config.values.get(STOP_AFTER)
    return differ and bool(layout.read_json(folder / layout.STATUS).get("reason"))


def _is_damaged(folder: Path) -> bool:
    try:
        verify_folder(folder)
        return not is_complete(folder)
    except InputError:  # resuming reports the damage, and repairs or rejects it
        return True


def _require_same_designs(folder: Path, config: Configuration) -> None:
    files = write_designs(read_sources(config.designs, config.build()))
    if any(read_bytes(folder / name) != text.encode() for name, text in files.items()):
        raise InputError(
            f"designs: have changed since the evaluation in {folder} began; choose another "
            f"hydra.sweep.dir"
        )


def require_same(folder: Path, config: Configuration) -> None:
    """Check that the run in a folder has the configuration of a job, apart from the executor."""
    require_no_links(folder)
    text = read_original(folder, layout.CONFIG, read_sealed(folder, layout.MANIFEST)).decode()
    if layout.evaluates(folder) != config.evaluates:
        other = "an evaluation" if config.evaluates else "a search"
        raise InputError(f"{folder}: must contain {other}; choose another hydra.sweep.dir")
    if text == config.text:  # identical texts need no parsing
        return
    difference = find_difference(read_recorded(folder / layout.CONFIG), config)
    if difference:
        raise InputError(
            f"{folder}: must have the configuration of its job, but {difference}; choose another "
            f"hydra.sweep.dir"
        )
