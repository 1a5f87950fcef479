"""The status of a run or an evaluation, in status.json and in the log."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from logging import LogRecord
from pathlib import Path
from typing import Any, Protocol

from evoros.base.log import LOGGER, log_to_file
from evoros.evolution.journal import Generation, Observer
from evoros.mission.mission import Mission
from evoros.mission.outcome import Outcome
from evoros.mission.plan import describe
from evoros.storage.mission_log import LOG
from evoros.storage.run_folder import RunFolder

RUNNING, FINISHED, STOPPED = "running", "finished", "stopped"


class Display(Observer, Protocol):
    """An observer that is told when the run starts."""

    def start(self, generations: int) -> None:
        """The run is built and recorded; it starts now, with so many generations."""
        ...


class NoDisplay:
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
            "generation %d/%d: %s", generation.number, self.generations - 1, generation.summary
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


@contextmanager
def recording(
    folder: Path, said: Sequence[LogRecord], write: Callable[[str, str], None]
) -> Iterator[None]:
    """Work in a folder: its log, and its status, which ``write`` is told with a reason.

    ``said`` are messages from before there was a folder.
    """
    with log_to_file(folder / LOG, said):
        write(RUNNING, "")
        try:
            yield
        except BaseException as error:
            LOGGER.debug("stopped", exc_info=True)  # the traceback goes into the file alone
            interrupted = isinstance(error, KeyboardInterrupt)
            write(STOPPED, "interrupted" if interrupted else str(error))
            raise
        write(FINISHED, "")
