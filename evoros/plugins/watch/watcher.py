"""Watches folders while a page is open, and redraws figures whose inputs change."""

import logging
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import NoReturn

from markupsafe import Markup

from evoros.analysis.report.frame import Page
from evoros.analysis.report.page import make_page
from evoros.analysis.report.playback import Flown
from evoros.analysis.report.summary import name_page
from evoros.analysis.subcommands import parse
from evoros.analysis.tables.champions import find_shown
from evoros.analysis.tables.loading import load_study
from evoros.analysis.tables.records import Record
from evoros.analysis.tables.shown import keeps_shown
from evoros.analysis.tables.study import Study, read_complete
from evoros.base.errors import InputError, single_line
from evoros.executor.processes import available_cores
from evoros.plugins.watch import server
from evoros.plugins.watch.folders import Folders, Look
from evoros.session.status import is_locked
from evoros.terminal.log import withhold_messages

PLANE = ["evoros.simulator.planar.Planar"]
PATIENCE_S = 120.0
Key = tuple[Path, int]  # folder and design
LOOK_S = 2.0  # interval [s] between snapshots
IDLE_S = 30.0  # time [s] without requests after which nothing is read
SHARE = 0.01  # maximum fraction of processor time that drawing may take from runs
MOST_REASONS = 3
FIRST = ("Progress", "Player", "Figures")  # sections at the top of the page


@dataclass
class Flights:
    """Reruns the missions of the current best design of the best unfinished run.

    Only this user's runs on this machine count, because their code is executed here anyway.
    """

    _flown: dict[Key, Markup] = field(default_factory=dict)
    _failed: dict[Key, str] = field(default_factory=dict)
    _process: "subprocess.Popen[str] | None" = None
    _closed: bool = False

    def update(self, study: Study) -> Flown:
        """Rerun missing missions of the best run; return all known missions of the study."""
        unfinished = [
            record  # the run has a best design without stored missions
            for record in study.ordered
            if not record.finished and _find_design(record) >= 0 and not keeps_shown(record)
        ]
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
        """Kill the running process, if any."""
        self._closed = True
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def _fly(self, record: Record, key: Key) -> None:
        program = [sys.executable, "-m", "evoros.plugins.watch.flight"]
        command, pipe = [*program, str(record.path), record.name], subprocess.PIPE
        with subprocess.Popen(command, stdout=pipe, stderr=pipe, encoding="utf-8") as self._process:
            if self._closed:
                self._process.kill()
            try:
                content, error = self._process.communicate(timeout=PATIENCE_S)
            except subprocess.TimeoutExpired:
                self._process.kill()
                content, error = "", "the missions take too long"
        if self._process.returncode == 0:
            self._flown[key] = Markup(content.strip())
        else:
            self._failed[key] = error.strip().rpartition("\n")[2] or "the process exited"


def _write_notes(flown: Sequence[str], obstacles: Mapping[Record, str]) -> Iterator[str]:
    if flown:
        yield f"Missions rerun for this page, because the run stores none: {', '.join(flown)}."
    for record, reason in obstacles.items():
        if reason and record.name not in flown:
            yield f"{record.name}: missions could not be rerun for this page ({reason})."
            return


def _find_design(record: Record) -> int:
    try:
        design = read_complete(record, find_shown)
    except InputError:
        return -1
    return -1 if design is None else design


def _find_obstacle(record: Record) -> str:
    if record.run.manifest.get("simulators") != PLANE:
        return "only planar missions are cheap to rerun; record=all stores all missions"
    if not (record.path.stat().st_uid == os.getuid() and is_locked(record.path)):
        return "the run is not in progress, or was started by another user or on another machine"
    return ""


@dataclass
class Watcher:
    """Updates the contents of the page in two threads, for reading and for drawing."""

    folders: Folders
    _contents: server.Contents = field(init=False)
    _parts: dict[str, server.Content] = field(default_factory=dict)
    _trouble: str = ""
    _drawn: tuple[object, ...] | None = None  # stamps at the time of the last drawing
    _drawn_at: str = ""
    _look: Look | None = None
    _asked_s: float = 0.0  # time.monotonic() [s] at the last request
    _awake: threading.Event = field(default_factory=threading.Event)
    _flights: Flights = field(default_factory=Flights)

    def __post_init__(self) -> None:
        self._parts = self._draw_parts(Page(""))

    def give(self) -> server.Contents:
        """Return the contents of all addresses, and record the time of the request."""
        idle = time.monotonic() - self._asked_s > IDLE_S
        self._asked_s = time.monotonic()
        if idle:
            self._awake.set()
        return self._contents

    def run(self) -> NoReturn:
        """Take snapshots until Ctrl-C raises KeyboardInterrupt."""
        self.look()
        threading.Thread(target=self._draw_again, daemon=True).start()
        while True:
            self._awake.wait(None if self._is_idle() else LOOK_S)
            self._awake.clear()
            self.look()

    def close(self) -> None:
        """Kill other processes."""
        self._flights.close()

    def look(self) -> None:
        """Take a snapshot of the folders, and update the progress section."""
        self._look = self.folders.look()
        progress = FIRST[0], server.render_progress(self._look, self._trouble)
        state = {
            "state": server.describe_state(self._look.overviews),
            "drawn": self._drawn_at,
            "behind": self._look.stamps != self._drawn,
        }
        self._contents = server.make_contents(self._title, self._parts, progress, state)

    def draw(self, look: Look) -> None:
        """Draw the page for a snapshot; on failure, store the reason."""
        begun = datetime.now(UTC).isoformat(timespec="seconds")
        with withhold_messages() as records:
            try:
                self._parts, self._trouble = self._draw_parts(self._make_page(look)), ""
            except InputError as error:
                warned = [record for record in records if record.levelno >= logging.WARNING]
                reasons = [record.getMessage() for record in warned[:MOST_REASONS]]
                self._trouble = single_line("; ".join(reasons or [str(error)]))
            except Exception as error:  # a run may be writing its files
                self._trouble = f"{type(error).__name__}: {single_line(error)}"
        self._drawn, self._drawn_at = look.stamps, begun

    @property
    def _title(self) -> str:
        return name_page(self.folders.paths)

    def _draw_parts(self, page: Page) -> dict[str, server.Content]:
        first = {name: page.sections.get(name, Markup()) for name in FIRST}
        kept = {name: part for name, part in first.items() if part or name == FIRST[0]}
        page = replace(page, title=self._title, sections={**kept, **page.sections})
        return server.draw_parts(page)

    def _make_page(self, look: Look) -> Page:
        paths = [path for path in self.folders.paths if path not in look.empty]
        if not paths:
            return Page("")
        options = parse(["report", *map(str, paths)])
        study = load_study(options.folders)
        flown = self._flights.update(study) if study.records else None
        return make_page(study, options, flown)

    def _draw_again(self) -> None:
        """Redraw whenever inputs of figures change, using at most ``SHARE`` of the processors."""
        while True:
            look = self._look
            same = look is None or (look.stamps == self._drawn and not self._trouble)
            if look is None or same or self._is_idle():
                time.sleep(LOOK_S / 10)
                continue
            begun_s = _processor_s()
            self.draw(look)
            self._awake.set()
            time.sleep(LOOK_S + (_processor_s() - begun_s) / (SHARE * available_cores()))

    def _is_idle(self) -> bool:
        return time.monotonic() - self._asked_s > IDLE_S


def _processor_s() -> float:
    times = os.times()
    return time.thread_time() + times.children_user + times.children_system
