"""Runs: a new one, one to be resumed, and what the commands and scripts call to do so."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from logging import LogRecord
from pathlib import Path

from evoros.base.errors import InputError
from evoros.base.log import LOGGER, collect_messages
from evoros.config.configuration import Configuration
from evoros.evolution.experiment import Experiment
from evoros.evolution.journal import Generation
from evoros.evolution.loop import evolve
from evoros.evolution.preflight import preflight
from evoros.executor.protocol import Executor
from evoros.session.figures import check_figures, discard_figures, draw_figures
from evoros.session.resume import rebuild
from evoros.session.status import FINISHED, Display, Recorder, Tally, recording
from evoros.session.work import PoolOpener, open_pool
from evoros.storage.figure_context import describe_experiment
from evoros.storage.manifest import manifest
from evoros.storage.mission_log import require_unused
from evoros.storage.run_folder import RunFolder


@dataclass(frozen=True)
class Session:
    """A run that can begin or go on; ``record`` is open until it has run."""

    experiment: Experiment
    record: RunFolder
    generations: int
    said: Sequence[LogRecord]  # while it was built

    @property
    def executor(self) -> Executor:
        """Where its missions are to be computed."""
        return self.experiment.executor

    def run(self, display: Display, opener: PoolOpener = open_pool) -> Generation:
        """To its end; returns the last generation.

        Raises:
            RunStopped: a mission was lost; the run can be resumed.
        """
        record, generations, figures = self.record, self.generations, self.experiment.figures
        if record.read_status().get("generations_done") != generations:
            discard_figures(record.path, figures)
        recorder = Recorder(record, display, generations, Tally(time.monotonic()))
        with record, recording(record.path, self.said, recorder.write):
            LOGGER.info(
                "%s: %d generations, seed %d, worlds %s, %d workers",
                record.path,
                generations,
                self.experiment.seed,
                ", ".join(self.experiment.world),
                self.executor.workers,
            )
            display.start(generations)
            with opener(self.executor) as pool:
                last = evolve(self.experiment, record, recorder, generations, pool)
                recorder.write(FINISHED)  # now, for figures are drawn of finished runs
                draw_figures(record.path, figures, pool)
        return last


def check_experiment(experiment: Experiment) -> None:
    """Refuse bad input before a run or an evaluation writes anything.

    Raises:
        InputError: the experiment would stop in its middle, or its figures cannot be drawn.
    """
    check_figures(experiment.figures)
    preflight(experiment)


def create_run(config: Configuration, folder: Path) -> Session:
    """The configured run, in a new folder.

    Raises:
        InputError: something cannot be used; the folder is then as it was.
    """
    require_unused(folder)  # before anything is built, which may take seconds
    with collect_messages() as said:
        experiment = config.build()
        check_experiment(experiment)
        described = manifest(experiment, config.text, config.values, config.choices)
    record = RunFolder.create(folder, config.text, described, describe_experiment(experiment))
    return Session(experiment, record, experiment.optimizer.generations, said)


def rebuild_experiment(folder: Path, config_dir: str | Path | None = None) -> Experiment:
    """The experiment of a recorded run. This runs the code that its configuration names.

    ``config_dir`` has the modules of the user's own parts, as when the run was started.

    Raises:
        InputError: no run there, or what it is made of has changed.
    """
    return rebuild(folder, (), config_dir)[0]


def open_run(
    folder: Path, overrides: Sequence[str] = (), config_dir: str | Path | None = None
) -> Session:
    """The run in the folder, to go on; a finished one is verified, and extended if asked to.

    ``overrides`` may change the executor and raise ``optimizer.generations``; ``config_dir`` has
    the modules of the user's own parts.

    Raises:
        InputError: no run there, another override, or what the run is made of has changed.
    """
    with collect_messages() as said:
        experiment, asked = rebuild(folder, overrides, config_dir)
        check_experiment(experiment)
    record = RunFolder(folder)
    reached = record.read_status().get("generations")
    known = reached if isinstance(reached, int) else experiment.optimizer.generations
    if asked is not None and asked < known:
        record.close()
        raise InputError(
            f"optimizer.generations: must be at least {known}, which the run already has, "
            f"not {asked}; a run can only be extended"
        )
    return Session(experiment, record, asked or known, said)
