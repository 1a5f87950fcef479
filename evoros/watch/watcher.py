"""Looks at folders while a page is open, and draws it anew when figures would change."""

import logging
import os
import threading
import time
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import NoReturn

from markupsafe import Markup

from evoros.analysis.report.frame import Page
from evoros.analysis.report.page import make_page
from evoros.analysis.report.summary import name_page
from evoros.analysis.subcommands import parse
from evoros.analysis.tables.loading import load_study
from evoros.base.errors import InputError, single_line
from evoros.executor.processes import available_cores
from evoros.terminal.log import withhold_messages
from evoros.watch.contents import Content, Contents, draw_parts, make_contents
from evoros.watch.flights import Flights
from evoros.watch.folders import Folders, Look
from evoros.watch.progress import describe_state, render_progress

LOOK_S = 2.0
"""Wall clock between two looks."""
IDLE_S = 30.0
"""Nothing is read if no page has asked for so long."""
SHARE = 0.01
"""Drawing takes at most this share of the processors, so that it costs no run more."""
MOST_REASONS = 3
FIRST = ("Progress", "Player", "Figures")
"""The sections that come first, for those who wait."""


@dataclass
class Watcher:
    """Keeps the contents of the page up to date in two threads: looking, and drawing."""

    folders: Folders
    _contents: Contents = field(init=False)
    _parts: dict[str, Content] = field(default_factory=dict)
    _trouble: str = ""
    _drawn: tuple[object, ...] | None = None  # the stamps of the figures
    _drawn_at: str = ""
    _look: Look | None = None
    _asked_s: float = 0.0  # of time.monotonic
    _awake: threading.Event = field(default_factory=threading.Event)
    _flights: Flights = field(default_factory=Flights)

    def __post_init__(self) -> None:
        self._parts = self._draw_parts(Page(""))

    def give(self) -> Contents:
        """Return the contents of all addresses, and note that a page is open."""
        idle = time.monotonic() - self._asked_s > IDLE_S
        self._asked_s = time.monotonic()
        if idle:
            self._awake.set()
        return self._contents

    def run(self) -> NoReturn:
        """Look again and again, until Ctrl-C raises KeyboardInterrupt."""
        self.look()
        threading.Thread(target=self._draw_again, daemon=True).start()
        while True:
            self._awake.wait(None if self._is_idle() else LOOK_S)
            self._awake.clear()
            self.look()

    def close(self) -> None:
        """End what goes on in other processes."""
        self._flights.close()

    def look(self) -> None:
        """Look at the folders, and tell the page how far they are."""
        self._look = self.folders.look()
        progress = FIRST[0], render_progress(self._look, self._trouble)
        state = {
            "state": describe_state(self._look.overviews),
            "drawn": self._drawn_at,
            "behind": self._look.stamps != self._drawn,
        }
        self._contents = make_contents(self._title, self._parts, progress, state)

    def draw(self, look: Look) -> None:
        """Draw the page of a look, or note why that cannot be done."""
        begun = datetime.now(UTC).isoformat(timespec="seconds")
        with withhold_messages() as records:
            try:
                self._parts, self._trouble = self._draw_parts(self._make_page(look)), ""
            except InputError as error:
                warned = [record for record in records if record.levelno >= logging.WARNING]
                reasons = [record.getMessage() for record in warned[:MOST_REASONS]]
                self._trouble = single_line("; ".join(reasons or [str(error)]))
            except Exception as error:  # a run may write its files meanwhile
                self._trouble = f"{type(error).__name__}: {single_line(error)}"
        self._drawn, self._drawn_at = look.stamps, begun

    @property
    def _title(self) -> str:
        return name_page(self.folders.paths)

    def _draw_parts(self, page: Page) -> dict[str, Content]:
        first = {name: page.sections.get(name, Markup()) for name in FIRST}
        kept = {name: part for name, part in first.items() if part or name == FIRST[0]}
        return draw_parts(replace(page, title=self._title, sections={**kept, **page.sections}))

    def _make_page(self, look: Look) -> Page:
        paths = [path for path in self.folders.paths if path not in look.empty]
        if not paths:
            return Page("")
        options = parse(["report", *map(str, paths)])
        study = load_study(options.folders)
        flown = self._flights.update(study) if study.records else None
        return make_page(study, options, flown)

    def _draw_again(self) -> None:
        """Draw whenever the figures would change, within ``SHARE``."""
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
    """Return the processor time of this thread and of processes that have ended."""
    times = os.times()
    return time.thread_time() + times.children_user + times.children_system
