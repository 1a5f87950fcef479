"""The states of run and evaluation folders, read while they are written or afterwards."""

import fcntl
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from evoros.session.status import UPDATE_S
from evoros.storage.layout import FINISHED, MISSIONS, RUNNING, STATUS, read_json

KILLED, BEGUN = "killed", "begun"
"""States: killed before the last status was written; no status written yet."""
SILENT_S = 3 * UPDATE_S
"""Age [s] of a status beyond which the process that wrote it may have ended."""


@dataclass(frozen=True)
class Overview:
    """The state of a folder; unknown numbers are None."""

    path: Path
    state: str  # running, finished, stopped, killed or begun
    units: str  # generations of a run, designs of an evaluation
    done: int  # number of finished units
    wanted: int
    best: float | None  # fitness
    validated: float | None  # fitness of the best design on fresh draws
    missions: int
    speed: float | None  # simulated seconds per wall-clock second in the last session
    left_s: float | None  # [s], wall clock; None unless running
    reason: str  # reason why the run stopped


COLUMNS = ("state", "done", "best", "validated", "missions", "sim s/s", "left")
"""Columns after the names in a table of folders."""
UNKNOWN = "-"


def list_cells(overview: Overview) -> tuple[str, ...]:
    """List the cells for ``COLUMNS``."""
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
    """Write a duration [s] as hours, minutes and seconds."""
    return str(timedelta(seconds=round(seconds)))


def _format(value: float | None, digits: int) -> str:
    return UNKNOWN if value is None else f"{value:.{digits}f}"


def survey(folder: Path) -> Overview:
    """Read the state of a folder, whose files may be missing or changing."""
    status = read_json(folder / STATUS)
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
        left_s=_estimate_left(status) if state == RUNNING else None,
        reason="" if state == FINISHED else status.get("reason", ""),
    )


def _find_state(folder: Path, status: Mapping[str, Any]) -> str:
    state = str(status.get("state", BEGUN))
    if state != RUNNING:
        return state
    age = datetime.now(UTC) - datetime.fromisoformat(status["updated"])
    return state if age.total_seconds() < SILENT_S or is_locked(folder) else KILLED


def is_locked(folder: Path) -> bool:
    """Return True if a process has the folder open for writing."""
    if not (folder / MISSIONS).is_file():  # opening a pipe would block
        return False
    try:
        with (folder / MISSIONS).open("rb") as missions:
            fcntl.flock(missions, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    return False


def _estimate_left(status: Mapping[str, Any]) -> float | None:
    """Estimate the remaining time [s] from the speed of this session.

    Future generations are assumed to need as many missions as past ones on average.
    """
    names = ("missions", "session_missions", "session_wall_s")
    missions, of_session, wall = (status.get(name) for name in names)
    wanted: float | None = status.get("missions_wanted")
    done, generations = status.get("generations_done"), status.get("generations")
    if wanted is None and missions and done and generations:
        wanted = missions * generations / done
    if wanted is None or missions is None or not of_session or not wall:
        return None
    return float(max(0.0, wanted - missions) * wall / of_session)
