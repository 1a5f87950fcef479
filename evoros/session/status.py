"""The state of a run: ``status.json``, the log, the terminal display, and the overview."""

import fcntl
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from logging import LogRecord
from pathlib import Path
from typing import Any

from evoros.base.errors import EvorosError, RunStopped
from evoros.evolution.journal import Watcher
from evoros.mission.mission import Mission, Outcomes, judge
from evoros.mission.plan import describe
from evoros.storage import layout
from evoros.storage.digests import Repair
from evoros.storage.run_folder import RunFolder
from evoros.terminal.log import LOGGER, log_to_file

UPDATE_S = 5.0  # minimum interval [s] between updates of ``status.json`` during missions


class Display(Watcher):
    """A watcher that is also notified when a run starts; its methods do nothing by default."""

    def start(self, generations: int) -> None:
        """Show the start of a run with ``generations`` generations to run."""


class NoDisplay(Display):
    """A display that shows nothing."""


@dataclass
class Status:
    """Writes ``status.json``; counts only the missions of this session."""

    folder: RunFolder
    display: Display
    describe: Callable[[], Mapping[str, Any]]  # fields specific to a search or an evaluation
    missions: int = 0
    simulated_s: float = 0.0
    started: float = field(default_factory=time.monotonic)
    written: float = 0.0  # time.monotonic() [s] at the last update
    finished: bool = False  # whether the final state is written

    @property
    def wall_s(self) -> float:
        """The wall-clock time [s] since the start of this session."""
        return time.monotonic() - self.started

    def mission(self, mission: Mission, outcomes: Outcomes) -> None:
        """Count a recorded mission, show the progress, and log why a mission failed."""
        self.missions += 1
        outcome = judge(outcomes)
        self.simulated_s += outcome.time_s
        if outcome.reason:
            LOGGER.warning("%s: %s: %s", describe(mission), outcome.ended, outcome.reason)
        self.display.mission(mission, outcomes)
        if time.monotonic() - self.written > UPDATE_S:
            self.write(layout.RUNNING)

    def write(self, state: str, reason: str = "") -> None:
        """Replace ``status.json`` unless its state is already ``FINISHED``."""
        if self.finished:
            return
        self.finished = state == layout.FINISHED
        self.written = time.monotonic()
        session = {
            "session_missions": self.missions,
            "session_simulated_s": round(self.simulated_s, 1),
            "session_wall_s": round(self.wall_s, 1),
            "updated": datetime.now(UTC).isoformat(timespec="seconds"),
        }
        missions = {"missions": len(self.folder.rows)}
        fields = {"state": state, "reason": reason, **self.describe(), **missions, **session}
        self.folder.write_status(fields)

    @contextmanager
    def track(self, earlier: Sequence[LogRecord]) -> Iterator[None]:
        """Log to the run folder, and write the status when the session starts and ends."""
        with log_to_file(self.folder.path / layout.LOG, earlier):
            self.write(layout.RUNNING)
            try:
                yield
            except BaseException as error:
                LOGGER.debug("stopped", exc_info=True)  # the traceback is logged only to the file
                self.write(layout.STOPPED, _explain_stop(error))
                if isinstance(error, SystemExit):  # a part called exit()
                    raise RunStopped(f"SystemExit: {error}") from error
                raise
            self.write(layout.FINISHED)


def _explain_stop(error: BaseException) -> str:
    if isinstance(error, KeyboardInterrupt):
        return "interrupted"
    return str(error) if isinstance(error, EvorosError) else f"{type(error).__name__}: {error}"


CONSEQUENCES = {
    layout.MISSIONS: "missions without rows will be rerun",
    layout.DIGESTS: "rewritten with digests of the known files",
}
"""Consequences of a lost or damaged file, for files without a backup copy."""


def log_repair(repair: Repair) -> None:
    """Log the repair of a lost or damaged file."""
    name = repair.path.name
    if repair.problem:
        kept = f"the damaged file is kept as {repair.kept}" if repair.kept else CONSEQUENCES[name]
        LOGGER.warning("%s%s: %s; %s", repair.path, repair.where, repair.problem, kept)
        return
    if repair.kept is not None:
        lost = ", repeated, from another run, or without a trajectory"
        LOGGER.warning(
            "%s%s: damaged (for example by a disk fault or an editor)%s; the file is rewritten, "
            "and the "
            "damaged file is kept as %s",
            *(repair.path, repair.where, lost if name == layout.MISSIONS else "", repair.kept),
        )
        return
    damage = f"{repair.where}: damaged" if repair.where else ": missing"
    effects = {
        layout.MISSIONS: "; all missions will be rerun",
        layout.DIGESTS: " with digests of the known files",
    }
    LOGGER.warning("%s%s; rewritten%s", repair.path, damage, effects.get(name, ""))


KILLED, BEGUN = "killed", "begun"  # states of a killed run, and of a run without a status
SILENT_S = 3 * UPDATE_S  # age [s] of a status after which the process is assumed to have ended


@dataclass(frozen=True)
class Overview:
    """The state of a run folder; unknown numbers are None."""

    path: Path
    state: str  # running, finished, stopped, killed or begun
    units: str  # "generations" for a search, "designs" for an evaluation
    done: int  # number of completed units
    wanted: int
    best: float | None  # fitness
    validated: float | None  # fitness of the best design on fresh draws
    missions: int
    speed: float | None  # simulated seconds per wall-clock second in the last session
    left_s: float | None  # remaining wall-clock time [s]; None unless running
    reason: str  # reason why the run stopped


COLUMNS = ("state", "done", "best", "validated", "missions", "sim s/s", "left")
"""The columns that follow the folder names in a table of runs."""
UNKNOWN = "-"


def list_cells(overview: Overview) -> tuple[str, ...]:
    """Return the table cells for ``COLUMNS``."""
    return (
        overview.state,
        f"{overview.done}/{overview.wanted}" if overview.wanted else UNKNOWN,
        _format(overview.best, 3),
        _format(overview.validated, 3),
        str(overview.missions),
        _format(overview.speed, 0),
        UNKNOWN if overview.left_s is None else write_clock(overview.left_s),
    )


def write_clock(seconds: float) -> str:
    """Format a duration [s] as hours, minutes and seconds."""
    return str(timedelta(seconds=round(seconds)))


def _format(value: float | None, digits: int) -> str:
    return UNKNOWN if value is None else f"{value:.{digits}f}"


def survey(folder: Path) -> Overview:
    """Read the state of a run folder; files may be missing or may change during the reading."""
    status = layout.read_json(folder / layout.STATUS)
    units = "generations" if "generations" in status else "designs"
    wall, simulated = status.get("session_wall_s"), status.get("session_simulated_s")
    state = _find_state(folder, status)
    return Overview(
        path=folder,
        state=state,
        units=units,
        done=status.get(f"{units}_done", 0),
        wanted=status.get(units, 0),
        best=status.get("best_fitness"),
        validated=status.get("best_validated_fitness"),
        missions=status.get("missions", 0),
        speed=simulated / wall if wall and simulated is not None else None,
        left_s=_estimate_left(status) if state == layout.RUNNING else None,
        reason="" if state == layout.FINISHED else status.get("reason", ""),
    )


def _find_state(folder: Path, status: Mapping[str, Any]) -> str:
    state = str(status.get("state", BEGUN))
    if state != layout.RUNNING:
        return state
    age = datetime.now(UTC) - datetime.fromisoformat(status["updated"])
    return state if age.total_seconds() < SILENT_S or is_locked(folder) else KILLED


def is_locked(folder: Path) -> bool:
    """Return True if a process has the folder open for writing."""
    if not (folder / layout.MISSIONS).is_file():  # opening a named pipe would block
        return False
    try:
        with (folder / layout.MISSIONS).open("rb") as missions:
            fcntl.flock(missions, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    return False


def _estimate_left(status: Mapping[str, Any]) -> float | None:
    """Estimate the remaining time [s] if later generations run as many missions as earlier ones."""
    names = ("missions", "session_missions", "session_wall_s")
    missions, of_session, wall = (status.get(name) for name in names)
    wanted: float | None = status.get("missions_wanted")
    done, generations = status.get("generations_done"), status.get("generations")
    if wanted is None and missions and done and generations:
        wanted = missions * generations / done
    if wanted is None or missions is None or not of_session or not wall:
        return None
    return float(max(0.0, wanted - missions) * wall / of_session)
