"""Runs: creates a new one, opens a recorded one, and runs either to its end."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from logging import LogRecord
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.certificate.certificate import Certificate
from evoros.config.configuration import Configuration
from evoros.config.recorded import GENERATIONS, flatten_recorded
from evoros.evolution.experiment import Experiment
from evoros.evolution.journal import Ending, Generation
from evoros.evolution.loop import evolve
from evoros.executor.protocol import Executor, Pool
from evoros.mission.mission import Mission
from evoros.mission.outcome import Outcomes
from evoros.mission.plan import CONFIRMATION, EVALUATION, SELECTION
from evoros.preflight.drive import report_drive
from evoros.preflight.preflight import preflight
from evoros.preflight.repeatability import report_repeatability
from evoros.session.figures import Draw, discard_figures, draw_figures
from evoros.session.observation import Tell, ignore, observe
from evoros.session.resume import ORIGINALS_OF, rebuild
from evoros.session.status import Display, Status, log_repair, log_start
from evoros.session.work import PoolOpener, open_pool
from evoros.storage.creation import require_unused
from evoros.storage.figure_context import describe_experiment
from evoros.storage.layout import CONFIG, CONFIG_DIR, FINISHED, RUN, RUNNING, STATUS, SWEEP
from evoros.storage.manifest import manifest
from evoros.storage.run_folder import RunFolder
from evoros.storage.verification import find_strays
from evoros.terminal.log import LOGGER, collect_messages, log_progress


@dataclass(frozen=True)
class Session:
    """A run that is built and recorded; ``record`` stays open until ``run`` has ended."""

    experiment: Experiment
    record: RunFolder
    generations: int
    messages: Sequence[LogRecord]  # logged while it was built
    extended: bool = False  # whether it may have ended, or have had an end, at other generations
    observed: bool = True  # whether its observers are told

    @property
    def executor(self) -> Executor:
        """Computes the missions."""
        return self.experiment.executor

    def run(self, display: Display, draw: Draw, opener: PoolOpener = open_pool) -> Ending:
        """Run to the end and return how it ended.

        Raises:
            RunStopped: a mission was lost; the run can be resumed.
        """
        record, generations, figures = self.record, self.generations, self.experiment.figures
        if record.read_status().get("generations_done") != generations:
            discard_figures(record.path, figures)
        watcher = _RunWatcher(record, display, generations)
        observers = self.experiment.observers if self.observed else {}
        with (
            record,
            watcher.status.track(self.messages),
            observe(record.path, observers) as watcher.tell,
        ):
            record.mend(describe_experiment(self.experiment).text, ORIGINALS_OF[RUN])
            display.start(generations)
            with opener(self.executor) as pool:
                log_start(record.path, f"{generations} generations", self.experiment, pool)
                report_drive(self.experiment, pool)
                self._report_repeatability(pool)
                ending = evolve(self.experiment, record, watcher, generations, pool)
                watcher.certificate = ending.certificate
                record.complete(generations, self.extended)
                watcher.status.write(FINISHED)  # first: figures are drawn of finished runs
                draw_figures(record.path, figures, pool, draw)
        return ending

    def _report_repeatability(self, pool: Pool) -> None:
        """Check the first mission of a new run, with each of its controllers."""
        experiment = self.experiment
        if len(self.record.rows):
            return
        individual = experiment.start_search().ask()[0]
        design = experiment.space.decode(individual.genome)
        scenarios = {SELECTION: experiment.scenario}
        if experiment.confirmation is not None and experiment.confirmation.controller is not None:
            scenarios[CONFIRMATION] = experiment.confirming
        for purpose, scenario in scenarios.items():
            first = experiment.plan.missions(purpose, 0, individual.id, design)[0]
            report_repeatability(scenario, first, pool)


@dataclass
class _RunWatcher:
    """Passes on what happens in a run to its status, its log and its display."""

    record: RunFolder
    display: Display
    generations: int
    last: Generation | None = None
    tell: Tell = ignore  # the observers, of so many generations
    certificate: Certificate | None = None  # at the end
    status: Status = field(init=False)

    def __post_init__(self) -> None:
        self.status = Status(self.record, self.display, self._describe)

    def begin(self, generation: int, missions: int, known: int) -> None:
        """Show the missions that are needed."""
        self.display.begin(generation, missions, known)

    def mission(self, mission: Mission, outcomes: Outcomes) -> None:
        """Count and show a mission."""
        self.status.mission(mission, outcomes)

    def generation(self, generation: Generation) -> None:
        """Write, log and show a generation."""
        self.last = generation
        self.status.write(RUNNING)
        log_progress(
            "generation %d/%d: %s", generation.number, self.generations - 1, generation.summary
        )
        self.display.generation(generation)
        self.tell(generation.number + 1)

    def _describe(self) -> dict[str, Any]:
        """Return the fields of ``status.json`` that only a run has."""
        last, certificate = self.last, self.certificate
        fields = {
            "generations": self.generations,
            "generations_done": 0 if last is None else last.number + 1,
            "best_fitness": None if last is None else last.best.fitness,
            "best_validated_fitness": None if last is None else last.validated,
            **dict.fromkeys(("validated_trials", "fitness_low", "fitness_high")),
            "chance_of_better": None,
            "best_loss": None if last is None else last.loss,
            "mean_loss": None if last is None else last.mean_loss,
            "confirmed": 0 if last is None else len(last.losses),
            "missions": len(self.record.rows),
        }
        return fields if certificate is None else {**fields, **certificate.summary}


def create_run(config: Configuration, folder: Path) -> Session:
    """Build and record a run in a new folder.

    Raises:
        InputError: something cannot be used; the folder is unchanged.
    """
    require_unused(folder)  # before the experiment is built, which may take seconds
    with collect_messages() as messages:
        experiment = config.build()
        for observer in experiment.observers.values():
            observer.check()
        if experiment.requirements:
            raise InputError(
                "requirements: must be none in a run; test its champion with evoros evaluate "
                "like=FOLDER requirements=..."
            )
        if experiment.worst_cases is not None:
            raise InputError(
                "worst_cases: must be none in a run; search the cases of its champion with "
                "evoros evaluate designs=FOLDER worst_cases=search"
            )
        if experiment.evaluation_draws != EVALUATION:
            raise InputError(
                "evaluation_draws: must not be set in a run, which validates by itself; give it to "
                "evoros evaluate designs=FOLDER"
            )
        return record_run(experiment, config, folder, messages)


def record_run(
    experiment: Experiment,
    config: Configuration,
    folder: Path,
    messages: Sequence[LogRecord],
    generations: int | None = None,
) -> Session:
    """Record a run in a new folder; ``generations`` may be more than those of its configuration.

    Raises:
        InputError: something cannot be used; the folder is unchanged.
    """
    preflight(experiment)
    content = manifest(experiment, config.text, config.values, config.choices)
    content[CONFIG_DIR] = config.config_dir
    content[SWEEP] = config.sweep
    record = RunFolder.create(folder, config.text, content, describe_experiment(experiment))
    return Session(experiment, record, generations or experiment.optimizer.generations, messages)


def rebuild_experiment(folder: Path, config_dir: str | Path | None = None) -> Experiment:
    """Build the experiment of a recorded run. This runs the code that its configuration names.

    ``config_dir`` has the modules of the user's own parts, as when the run was started.

    Raises:
        InputError: the folder has no run, or something that the run is made of has changed.
    """
    return rebuild(folder, (), config_dir).experiment


def _count_generations(record: RunFolder, experiment: Experiment) -> int:
    """Count the generations that a run has to have: it may have been extended before."""
    written = max(experiment.optimizer.generations, record.count_generations())
    recorded = record.read_status().get("generations")
    if isinstance(recorded, int):
        return max(recorded, written)
    if not len(record.rows):  # ended before it wrote one
        return written
    LOGGER.warning(
        "%s: missing or damaged; the run goes on to %d generations, those of %s or of its tables; "
        "if it had been extended further, repeat optimizer.generations=...",
        *(record.path / STATUS, written, CONFIG),
    )
    return written


def open_run(
    folder: Path, overrides: Sequence[str] = (), config_dir: str | Path | None = None
) -> Session:
    """Open the run in a folder to resume it; running a finished one verifies it.

    ``overrides`` may change the executor and the observers, and raise ``optimizer.generations``;
    ``config_dir`` has the modules of the user's own parts.

    Raises:
        InputError: the folder has no run, another override, or something that the run is made of
            has changed.
    """
    with collect_messages() as messages:
        experiment, wanted, _ = rebuild(folder, overrides, config_dir)
        preflight(experiment)
        record = RunFolder(folder, log_repair)
        for file in find_strays(folder, record.digests.entries):
            LOGGER.warning("%s: is no table that the run has written; not read", file)
        known = _count_generations(record, experiment)
        first = flatten_recorded(folder / CONFIG).get(GENERATIONS)
        extended = not record.read_status() or (wanted or known) != first
    if wanted is not None and wanted < known:
        record.close()
        raise InputError(
            f"optimizer.generations: must be at least {known}, which the run already has, "
            f"not {wanted}; a run can only be extended"
        )
    return Session(experiment, record, wanted or known, messages, extended)
