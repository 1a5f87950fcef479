"""Missions of the best design so far that a running run has not kept, flown again beside it."""

import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from markupsafe import Markup

from evoros.analysis.report.playback import Flown
from evoros.analysis.tables.champions import find_shown
from evoros.analysis.tables.records import Record
from evoros.analysis.tables.shown import keeps_shown
from evoros.analysis.tables.study import Study, read_complete
from evoros.base.errors import InputError
from evoros.session.overview import is_locked

PLANE = ["evoros.simulator.planar.Planar"]
PATIENCE_S = 120.0
Key = tuple[Path, int]  # folder and design


@dataclass
class Flights:
    """Flies the best design so far of the best running run, when it is another one.

    A run that is locked runs on this machine, so that its code runs for the user anyway; the code
    of other folders is never run.
    """

    _flown: dict[Key, Markup] = field(default_factory=dict)
    _failed: dict[Key, str] = field(default_factory=dict)
    _process: "subprocess.Popen[str] | None" = None
    _closed: bool = False

    def update(self, study: Study) -> Flown:
        """Fly what is missing of the best run; return all that is known of the study."""
        unfinished = [record for record in study.ordered if _has_none(record)]
        keys = {record: (record.path, _find_design(record)) for record in unfinished}
        obstacles = {record: _find_obstacle(record) for record in unfinished}
        for record in [record for record in unfinished if not obstacles[record]][:1]:
            if keys[record] not in self._flown and keys[record] not in self._failed:
                self._fly(record, keys[record])
            obstacles[record] = self._failed.get(keys[record], "")
        known = {record: self._flown[key] for record, key in keys.items() if key in self._flown}
        self._flown = {keys[record]: content for record, content in known.items()}
        notes = list(_write_notes([record.name for record in known], obstacles))
        return Flown({record.name: content for record, content in known.items()}, notes)

    def close(self) -> None:
        """End a flight that is in the air."""
        self._closed = True
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def _fly(self, record: Record, key: Key) -> None:
        command = [sys.executable, "-m", "evoros.watch.flight", str(record.path), record.name]
        pipe = subprocess.PIPE
        with subprocess.Popen(command, stdout=pipe, stderr=pipe, encoding="utf-8") as self._process:
            if self._closed:
                self._process.kill()
            try:
                content, error = self._process.communicate(timeout=PATIENCE_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                content, error = "", "it takes too long"
        if self._process.returncode == 0:
            self._flown[key] = Markup(content.strip())
        else:
            self._failed[key] = error.strip().rpartition("\n")[2] or "its process ended"


def _write_notes(flown: Sequence[str], obstacles: Mapping[Record, str]) -> Iterator[str]:
    """Yield whose missions were flown, and why the best others were not."""
    if flown:
        yield f"Flown again for this page, as the run keeps none: {', '.join(flown)}."
    for record, reason in obstacles.items():
        if reason and record.name not in flown:
            yield f"{record.name}: its missions are not flown again, {reason}."
            return


def _has_none(record: Record) -> bool:
    """Whether a run has a best design so far, and has kept none of its missions."""
    return not record.finished and _find_design(record) >= 0 and not keeps_shown(record)


def _find_design(record: Record) -> int:
    """Find the best design so far; -1: there is none."""
    try:
        design = read_complete(record, find_shown)
    except InputError:
        return -1
    return -1 if design is None else design


def _find_obstacle(record: Record) -> str:
    """Return why the missions of a run are not flown again; empty if nothing is against it."""
    if record.run.manifest.get("simulators") != PLANE:
        return "as this costs little in the plane alone; record=all keeps them"
    if not (record.path.stat().st_uid == os.getuid() and is_locked(record.path)):
        return "as the run does not go on now, on this machine and for this user"
    return ""
