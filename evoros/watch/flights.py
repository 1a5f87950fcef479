"""Missions of the best design so far that a running run has not kept, flown again beside it."""

import os
import subprocess
import sys
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
        notes = []
        for record, key in list(keys.items())[:1]:  # the best
            reason = _find_obstacle(record)
            if not reason and key not in self._flown and key not in self._failed:
                self._fly(record, key)
            reason = reason or self._failed.get(key, "")
            notes += [f"{record.name}: not flown again, {reason}."] if reason else []
        known = {record: self._flown[key] for record, key in keys.items() if key in self._flown}
        if known:
            names = ", ".join(record.name for record in known)
            notes.append(f"Flown again for this page, beside the run, which keeps none: {names}.")
        self._flown = {keys[record]: content for record, content in known.items()}
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
        with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True) as self._process:
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
        return "which costs little in the plane alone; record=all keeps them"
    if not (record.path.stat().st_uid == os.getuid() and is_locked(record.path)):
        return "because the run does not run on this machine now, for this user"
    return ""
