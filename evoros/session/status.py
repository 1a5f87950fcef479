"""The status of a run: ``status.json``, the log and the display on a terminal."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from logging import LogRecord
from typing import Any, Protocol

from evoros.base.errors import RunStopped
from evoros.evolution.journal import Generation, Watcher
from evoros.mission.mission import Mission, Outcomes, judge
from evoros.mission.plan import describe
from evoros.storage.digests import Repair
from evoros.storage.layout import DIGESTS, FINISHED, LOG, MISSIONS, RUNNING, STOPPED
from evoros.storage.run_folder import RunFolder
from evoros.terminal.log import LOGGER, log_to_file

UPDATE_S = 5.0
"""Minimum interval between updates of ``status.json`` during missions [s]."""


class Display(Watcher, Protocol):
    """A watcher that also displays the start of the work."""

    def start(self, generations: int) -> None:
        """Show the start of a recorded run of ``generations``."""


class NoDisplay:
    """A display that shows nothing."""

    def start(self, generations: int) -> None:
        """Ignore the start."""

    def begin(self, generation: int, missions: int, known: int) -> None:
        """Ignore the needed missions."""

    def mission(self, mission: Mission, outcomes: Outcomes) -> None:
        """Ignore a mission."""

    def generation(self, generation: Generation) -> None:
        """Ignore a generation."""


@dataclass
class Status:
    """Writes ``status.json``, and counts the missions of this session, not of earlier ones."""

    folder: RunFolder
    display: Display
    describe: Callable[[], Mapping[str, Any]]  # fields of a search or an evaluation
    missions: int = 0
    simulated_s: float = 0.0
    started: float = field(default_factory=time.monotonic)
    written: float = 0.0  # [s], time.monotonic() at the last update
    finished: bool = False  # a final state, which errors in figures do not change

    def mission(self, mission: Mission, outcomes: Outcomes) -> None:
        """Count and show a recorded mission; log the reason if it failed."""
        self.missions += 1
        outcome = judge(outcomes)
        self.simulated_s += outcome.time_s
        if outcome.reason:
            LOGGER.warning("%s: %s: %s", describe(mission), outcome.ended, outcome.reason)
        self.display.mission(mission, outcomes)
        if time.monotonic() - self.written > UPDATE_S:
            self.write(RUNNING)

    def write(self, state: str, reason: str = "") -> None:
        """Replace ``status.json``, unless its state is ``FINISHED``."""
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
        missions = {"missions": len(self.folder.rows)}
        fields = {"state": state, "reason": reason, **self.describe(), **missions, **session}
        self.folder.write_status(fields)

    @contextmanager
    def track(self, earlier: Sequence[LogRecord]) -> Iterator[None]:
        """Log to the folder, and write the status at the start and at the end of the run."""
        with log_to_file(self.folder.path / LOG, earlier):
            self.write(RUNNING)
            try:
                yield
            except BaseException as error:
                LOGGER.debug("stopped", exc_info=True)  # only the file gets the traceback
                interrupted = isinstance(error, KeyboardInterrupt)
                self.write(STOPPED, "interrupted" if interrupted else str(error))
                if isinstance(error, SystemExit):  # a part called exit()
                    raise RunStopped(f"SystemExit: {error}") from error
                raise
            self.write(FINISHED)


CONSEQUENCES = {
    MISSIONS: "missing missions run again",
    DIGESTS: "rewritten for known files",
}
"""Consequences of a problem in a file without a backup copy."""


def log_repair(repair: Repair) -> None:
    """Log the repair of a lost or damaged file."""
    name = repair.path.name
    if repair.problem:
        kept = f"the damaged file is kept as {repair.kept}" if repair.kept else CONSEQUENCES[name]
        LOGGER.warning("%s%s: %s; %s", repair.path, repair.where, repair.problem, kept)
        return
    if repair.kept is not None:
        lost = ", repeated, of another run, or without its trajectory"
        LOGGER.warning(
            "%s%s: damaged (for example by a disk fault or an editor)%s; rewritten; the damaged "
            "file is kept as %s",
            *(repair.path, repair.where, lost if name == MISSIONS else "", repair.kept),
        )
        return
    damage = f"{repair.where}: damaged" if repair.where else ": missing"
    effects = {MISSIONS: "; all missions run again", DIGESTS: " for known files"}
    LOGGER.warning("%s%s; rewritten%s", repair.path, damage, effects.get(name, ""))
