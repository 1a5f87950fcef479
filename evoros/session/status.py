"""The status of a run or an evaluation: ``status.json``, the log and the display on a terminal."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from logging import LogRecord
from pathlib import Path
from typing import Any, Protocol

from evoros.evolution.experiment import Experiment
from evoros.evolution.journal import Generation, Watcher
from evoros.executor.protocol import Pool
from evoros.mission.mission import Mission
from evoros.mission.outcome import Outcomes, judge
from evoros.mission.plan import describe
from evoros.storage.layout import DIGESTS, FINISHED, LOG, MISSIONS, RUNNING, STOPPED
from evoros.storage.mission_log import MissionLog
from evoros.storage.repairs import Repair
from evoros.terminal.log import LOGGER, log_to_file

UPDATE_S = 5.0
"""Wall clock between two updates of ``status.json`` while missions finish."""


class Display(Watcher, Protocol):
    """A watcher that is told when the work starts."""

    def start(self, generations: int) -> None:
        """Note that the work, built and recorded, starts now with so many generations."""
        ...


class NoDisplay:
    """Shows nothing."""

    def start(self, generations: int) -> None:
        """Ignore the start."""

    def begin(self, generation: int, missions: int, known: int) -> None:
        """Ignore the missions that are needed."""

    def mission(self, mission: Mission, outcomes: Outcomes) -> None:
        """Ignore a mission."""

    def generation(self, generation: Generation) -> None:
        """Ignore a generation."""


@dataclass
class Status:
    """Keeps ``status.json`` of one folder and counts the missions of this session.

    The session began when the command was typed; earlier missions in the folder do not count.
    """

    folder: MissionLog
    display: Display
    describe: Callable[[], Mapping[str, Any]]  # the fields that only this kind of work has
    missions: int = 0
    simulated_s: float = 0.0
    started: float = field(default_factory=time.monotonic)
    written: float = 0.0  # of time.monotonic
    finished: bool = False  # final: an error while figures are drawn does not change it

    def mission(self, mission: Mission, outcomes: Outcomes) -> None:
        """Count and show a mission that is on disk; log why it failed, if it did."""
        self.missions += 1
        outcome = judge(outcomes)
        self.simulated_s += outcome.time_s
        if outcome.reason:
            LOGGER.warning("%s: %s: %s", describe(mission), outcome.ended, outcome.reason)
        self.display.mission(mission, outcomes)
        if time.monotonic() - self.written > UPDATE_S:
            self.write(RUNNING)

    def write(self, state: str, reason: str = "") -> None:
        """Replace ``status.json``. Nothing follows ``FINISHED``."""
        if self.finished:
            return
        self.finished = state == FINISHED
        self.written = time.monotonic()
        session = {
            "session_missions": self.missions,
            "session_simulated_s": round(self.simulated_s, 1),
            "session_wall_s": round(self.written - self.started, 1),
            "updated": datetime.now(UTC).isoformat(timespec="seconds"),
        }
        self.folder.write_status({"state": state, "reason": reason, **self.describe(), **session})

    @contextmanager
    def track(self, earlier: Sequence[LogRecord]) -> Iterator[None]:
        """Log into the folder, and write the status at the start and at the end of the work.

        ``earlier`` are messages from before the folder existed.
        """
        with log_to_file(self.folder.path / LOG, earlier):
            self.write(RUNNING)
            try:
                yield
            except BaseException as error:
                LOGGER.debug("stopped", exc_info=True)  # the traceback goes into the file alone
                interrupted = isinstance(error, KeyboardInterrupt)
                self.write(STOPPED, "interrupted" if interrupted else str(error))
                raise
            self.write(FINISHED)


def log_start(folder: Path, amount: str, experiment: Experiment, pool: Pool) -> None:
    """Log the first line of a run or an evaluation; ``amount`` tells how much there is to do."""
    LOGGER.info(
        "%s: %s, seed %d, worlds %s, %d workers",
        *(folder, amount, experiment.seed, ", ".join(experiment.world), pool.workers),
    )


CONSEQUENCES = {
    MISSIONS: "missions that are missing run again",
    DIGESTS: "written anew as far as files are known",
}
"""What follows from a problem of a file of which no copy is kept."""


def log_repair(repair: Repair) -> None:
    """Log that a file of a folder was lost or damaged, and is made anew."""
    name = repair.path.name
    if repair.problem:
        kept = f"what was there is in {repair.kept}" if repair.kept else CONSEQUENCES[name]
        LOGGER.warning("%s%s: %s; %s", repair.path, repair.where, repair.problem, kept)
        return
    if repair.kept is not None:
        lost = ", repeated, of another run, or without the trajectory that belongs to it"
        LOGGER.warning(
            "%s%s: damaged (a bad disk, or an editor)%s; made anew, and what was there is in %s",
            *(repair.path, repair.where, lost if name == MISSIONS else "", repair.kept),
        )
        return
    damage = f"{repair.where}: damaged" if repair.where else ": missing"
    effects = {MISSIONS: ", and all missions run again", DIGESTS: " as far as files are known"}
    LOGGER.warning("%s%s; written anew%s", repair.path, damage, effects.get(name, ""))
