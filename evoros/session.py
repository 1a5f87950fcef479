"""Runs: a new one, one to be resumed, and what the commands and scripts call to do so."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from logging import LogRecord
from pathlib import Path
from typing import Any, Protocol, TypeAlias

from omegaconf import DictConfig

from evoros import config as configuration
from evoros.errors import InputError
from evoros.evaluation import describe
from evoros.evolution import Evolution, Generation, Observer
from evoros.experiment import Experiment
from evoros.figures import discard_figures, draw_figures
from evoros.folder import LOG, require_unused
from evoros.log import LOGGER, logging_to_file, remembering
from evoros.manifest import manifest
from evoros.mission import Mission
from evoros.outcome import Outcome
from evoros.record import RunFolder
from evoros.resuming import rebuilt
from evoros.setting import setting_of
from evoros.types import Executor, Pool

RUNNING, FINISHED, STOPPED = "running", "finished", "stopped"


class Display(Observer, Protocol):
    """An observer that is told when the run starts."""

    def start(self, generations: int) -> None:
        """The run is built and recorded; it starts now, with so many generations."""
        ...


Opener: TypeAlias = Callable[[Executor], AbstractContextManager[Pool]]
"""How work gets the pool of its executor."""


def own_pool(executor: Executor) -> AbstractContextManager[Pool]:
    """A pool for this work alone."""
    return executor.open()


class Work(Protocol):
    """A run or an evaluation that can begin or go on: it is built, and its folder is there."""

    @property
    def executor(self) -> Executor:
        """Where its missions are to be computed."""
        ...

    def run(self, display: Display, opener: Opener = own_pool) -> object:
        """To its end.

        Raises:
            RunStopped: a mission was lost; the work can be resumed.
        """
        ...


class Silent:
    """Shows nothing."""

    def start(self, generations: int) -> None:
        """The run starts."""

    def begin(self, generation: int, missions: int, known: int) -> None:
        """Missions are wanted."""

    def mission(self, mission: Mission, outcome: Outcome) -> None:
        """A mission was flown."""

    def generation(self, generation: Generation) -> None:
        """A generation is over."""


@dataclass
class Tally:
    """What was flown since the command was typed."""

    started: float  # of time.monotonic
    missions: int = 0
    simulated: float = 0.0

    def count(self, mission: Mission, outcome: Outcome) -> None:
        """A mission was flown and is on disk; says why it failed, if it did."""
        self.missions += 1
        self.simulated += outcome.time_s
        if outcome.reason:
            LOGGER.warning("%s: %s: %s", describe(mission), outcome.ended, outcome.reason)

    @property
    def figures(self) -> dict[str, Any]:
        """The end of every ``status.json``."""
        return {
            "session_missions": self.missions,
            "session_simulated_s": round(self.simulated, 1),
            "session_wall_s": round(time.monotonic() - self.started, 1),
            "updated": datetime.now(UTC).isoformat(timespec="seconds"),
        }


@dataclass
class Recorder:
    """Keeps ``status.json`` and the log true and passes everything on to a display."""

    folder: RunFolder
    display: Display
    generations: int
    tally: Tally
    last: Generation | None = None
    over: bool = False  # finished: nothing that follows, such as a figure, changes that

    def begin(self, generation: int, missions: int, known: int) -> None:
        """Missions are wanted."""
        self.display.begin(generation, missions, known)

    def mission(self, mission: Mission, outcome: Outcome) -> None:
        """A mission was flown and is on disk."""
        self.tally.count(mission, outcome)
        self.display.mission(mission, outcome)

    def generation(self, generation: Generation) -> None:
        """A generation is over and on disk."""
        self.last = generation
        self.write(RUNNING)
        LOGGER.info(
            "generation %d/%d: %s", generation.number, self.generations - 1, generation.standing
        )
        self.display.generation(generation)

    def write(self, state: str, reason: str = "") -> None:
        """The status of the run; wall-clock figures are of this session alone."""
        last = self.last
        if self.over:
            return
        self.over = state == FINISHED
        self.folder.write_status(
            {
                "state": state,
                "reason": reason,
                "generations": self.generations,
                "generations_done": 0 if last is None else last.number + 1,
                "best_fitness": None if last is None else last.best.fitness,
                "best_validated_fitness": None if last is None else last.validated,
                "best_loss": None if last is None else last.loss,
                "mean_loss": None if last is None else last.mean_loss,
                "confirmed": 0 if last is None else len(last.losses),
                "missions": len(self.folder.outcomes),
            }
            | self.tally.figures
        )


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

    def run(self, display: Display, opener: Opener = own_pool) -> Generation:
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
            evolution = Evolution(self.experiment, record, recorder, generations)
            with opener(self.executor) as pool:
                last = evolution.run(pool)
                recorder.write(FINISHED)  # now, for figures are drawn of finished runs
                draw_figures(record.path, figures, pool)
        return last


def new(config: DictConfig, folder: Path) -> Session:
    """The configured run, in a new folder.

    Raises:
        InputError: something cannot be used; the folder is then as it was.
    """
    require_unused(folder)  # before anything is built, which may take seconds
    with remembering() as said:
        experiment = configuration.build(config)
        content = configuration.to_text(config)
        described = manifest(experiment, content, configuration.to_values(config))
    record = RunFolder.create(folder, content, described, setting_of(experiment))
    return Session(experiment, record, experiment.optimizer.generations, said)


def rebuild(folder: Path, config_dir: str | Path | None = None) -> Experiment:
    """The experiment of a recorded run. This runs the code that its configuration names.

    ``config_dir`` has the modules of the user's own parts, as when the run was started.

    Raises:
        InputError: no run there, or what it is made of has changed.
    """
    return rebuilt(folder, (), config_dir)[0]


def resumed(
    folder: Path, overrides: Sequence[str] = (), config_dir: str | Path | None = None
) -> Session:
    """The run in the folder, to go on; a finished one is verified, and extended if asked to.

    ``overrides`` may change the executor and raise ``optimizer.generations``; ``config_dir`` has
    the modules of the user's own parts.

    Raises:
        InputError: no run there, another override, or what the run is made of has changed.
    """
    with remembering() as said:
        experiment, asked = rebuilt(folder, overrides, config_dir)
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


@contextmanager
def recording(
    folder: Path, said: Sequence[LogRecord], write: Callable[[str, str], None]
) -> Iterator[None]:
    """Work in a folder: its log, and its status, which ``write`` is told with a reason.

    ``said`` are messages from before there was a folder.
    """
    with logging_to_file(folder / LOG, said):
        write(RUNNING, "")
        try:
            yield
        except BaseException as error:
            LOGGER.debug("stopped", exc_info=True)  # the traceback goes into the file alone
            interrupted = isinstance(error, KeyboardInterrupt)
            write(STOPPED, "interrupted" if interrupted else str(error))
            raise
        write(FINISHED, "")
