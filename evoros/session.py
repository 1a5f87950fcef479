"""Runs: starting one, resuming one, and what the commands and scripts call to do so."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from logging import LogRecord
from pathlib import Path
from typing import Any, Protocol

from omegaconf import DictConfig

from evoros import config as configuration
from evoros.errors import InputError
from evoros.evaluation import describe
from evoros.evolution import Evolution, Generation, Observer
from evoros.experiment import Experiment
from evoros.folder import LOG, require_unused
from evoros.log import LOGGER, logging_to_file, remembering
from evoros.manifest import manifest
from evoros.mission import Mission
from evoros.outcome import Outcome
from evoros.record import RunFolder
from evoros.resuming import rebuilt

RUNNING, FINISHED, STOPPED = "running", "finished", "stopped"


class Display(Observer, Protocol):
    """An observer that is told when the run starts."""

    def start(self, generations: int) -> None:
        """The run is built and recorded; it starts now, with so many generations."""
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


def start(config: DictConfig, folder: Path, display: Display) -> Generation:
    """Run the configured experiment in a new folder; returns its last generation.

    Raises:
        InputError: something cannot be used; the folder is then as it was.
        RunStopped: a mission was lost; the run can be resumed.
    """
    require_unused(folder)  # before anything is built, which may take seconds
    with remembering() as said:
        experiment = configuration.build(config)
        content = configuration.to_text(config)
        described = manifest(experiment, content, configuration.to_values(config))
    generations = experiment.optimizer.generations
    with RunFolder.create(folder, content, described) as record:
        return _evolve(experiment, record, generations, display, said)


def rebuild(folder: Path, config_dir: str | Path | None = None) -> Experiment:
    """The experiment of a recorded run. This runs the code that its configuration names.

    ``config_dir`` has the modules of the user's own parts, as when the run was started.

    Raises:
        InputError: no run there, or what it is made of has changed.
    """
    return rebuilt(folder, (), config_dir)[0]


def resume(
    folder: Path,
    overrides: Sequence[str],
    display: Display,
    config_dir: str | Path | None = None,
) -> Generation:
    """Go on with the run in the folder; a finished one is verified, and extended if asked to.

    ``overrides`` may change the executor and raise ``optimizer.generations``; ``config_dir`` has
    the modules of the user's own parts.

    Raises:
        InputError: no run there, another override, or what the run is made of has changed.
        RunStopped: as in ``start``.
    """
    with remembering() as said:
        experiment, asked = rebuilt(folder, overrides, config_dir)
    with RunFolder(folder) as record:
        reached = record.read_status().get("generations")
        known = reached if isinstance(reached, int) else experiment.optimizer.generations
        if asked is not None and asked < known:
            raise InputError(
                f"optimizer.generations: must be at least {known}, which the run already has, "
                f"not {asked}; a run can only be extended"
            )
        return _evolve(experiment, record, asked or known, display, said)


def _evolve(
    experiment: Experiment,
    record: RunFolder,
    generations: int,
    display: Display,
    said: Sequence[LogRecord],
) -> Generation:
    recorder = Recorder(record, display, generations, Tally(time.monotonic()))
    with recording(record.path, said, recorder.write):
        LOGGER.info(
            "%s: %d generations, seed %d, worlds %s, %d workers",
            record.path,
            generations,
            experiment.seed,
            ", ".join(experiment.world),
            experiment.executor.workers,
        )
        display.start(generations)
        return Evolution(experiment, record, recorder, generations).run()


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
