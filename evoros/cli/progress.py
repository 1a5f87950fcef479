"""The live line on a terminal: the progress of a run, or of all runs of a sweep."""

import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Self

from evoros.base.log import LOGGER, attach, detach, format_for_terminal
from evoros.evolution.journal import Generation
from evoros.mission.mission import Mission
from evoros.mission.outcome import Outcome

if TYPE_CHECKING:
    from rich.console import Console


class Progress:
    """The display of one run, a context manager. It shows nothing unless it is ``live``."""

    def __init__(self, live: bool) -> None:
        self._since = time.monotonic()
        self.missions, self.simulated, self.ended = 0, 0.0, False  # of this session
        self._generations = self._generation = 0
        self._wanted = self._known = self._done = 0
        self._totals: list[int] = []  # missions run by the end of each generation that ran any
        self._standing = ""
        self._live = _LiveLine(self.line) if live else None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.ended = True
        if self._live:
            self._live.stop()

    def start(self, generations: int) -> None:
        """The run starts now, with so many generations."""
        self._since, self._generations = time.monotonic(), generations
        if self._live:
            self._live.start()

    def begin(self, generation: int, missions: int, known: int) -> None:
        """A generation needs missions, of which ``known`` are on disk already."""
        self._generation, self._wanted, self._known, self._done = generation, missions, known, 0

    def mission(self, mission: Mission, outcome: Outcome) -> None:
        """A mission was run."""
        self._done += 1
        self.missions += 1
        self.simulated += outcome.time_s

    def generation(self, generation: Generation) -> None:
        """A generation is over."""
        self._standing = f"best {generation.best.fitness:.3f}, mean {generation.mean:.3f}"
        if self.missions > sum(self._totals[-1:]):
            self._totals.append(self.missions)

    def line(self) -> str:
        """The progress of the run, in one line."""
        elapsed = time.monotonic() - self._since
        speed = self.simulated / elapsed if elapsed > 0 else 0.0
        parts = [
            f"generation {self._generation}/{last}" if (last := self._generations - 1) else "",
            self._standing,
            f"missions {self._known + self._done}/{self._wanted}",
            f"{speed:.0f} simulated s/s",
            f"{_clock(self._left() * elapsed / self.missions)} left" if self.missions else "",
        ]
        return " | ".join(part for part in parts if part)

    @property
    def share(self) -> float:
        """The share of this session's missions that has been run, as far as can be foreseen."""
        if self.ended:
            return 1.0
        return self.missions / (self.missions + self._left()) if self.missions else 0.0

    def _left(self) -> float:
        """Missions left if later generations need as many as those of this session did."""
        current = self._wanted - self._known - self._done
        later = self._totals[-1] / len(self._totals) if self._totals else self._wanted
        return current + later * (self._generations - 1 - self._generation)


class SweepProgress:
    """The display of a sweep of ``jobs`` jobs: one line for all."""

    def __init__(self, live: bool, jobs: int) -> None:
        self._since = time.monotonic()
        self._jobs, self._begun = jobs, list[Progress]()
        self._live = _LiveLine(self.line) if live else None

    def __enter__(self) -> Self:
        if self._live:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live:
            self._live.stop()

    def job(self) -> Progress:
        """The display of the next job."""
        self._begun.append(Progress(live=False))
        return self._begun[-1]

    @contextmanager
    def pause(self) -> Iterator[None]:
        """Remove the line while results are printed."""
        if self._live:
            self._live.stop()
        try:
            yield
        finally:
            if self._live:
                self._live.start()

    def line(self) -> str:
        """The progress of the sweep, in one line."""
        elapsed, begun = time.monotonic() - self._since, self._begun
        ended, share = sum(job.ended for job in begun), sum(job.share for job in begun)
        simulated = sum(job.simulated for job in begun)
        parts = [
            f"jobs {ended}/{self._jobs} done",
            f"{len(begun) - ended} running",
            f"missions {sum(job.missions for job in begun)}",
            f"{simulated / elapsed if elapsed > 0 else 0.0:.0f} simulated s/s",
            f"{_clock((self._jobs / share - 1) * elapsed)} left" if share > 0 else "",
        ]
        return " | ".join(part for part in parts if part)


def _clock(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{seconds:02d}"


class _LiveLine:
    """One line at the bottom of the terminal; log lines scroll above it."""

    def __init__(self, line: Callable[[], str]) -> None:
        from rich.console import Console
        from rich.live import Live
        from rich.text import Text

        console = Console(stderr=True)
        # Rich asks for the line four times a second, however many missions there are.
        self._live = Live(
            console=console,
            refresh_per_second=4,
            transient=True,
            get_renderable=lambda: Text(line()),
        )
        self._handler = format_for_terminal(_ConsoleHandler(console))
        self._stack = ExitStack()

    def start(self) -> None:
        for handler in LOGGER.handlers:
            if isinstance(handler, logging.StreamHandler) and handler.stream is sys.stderr:
                self._stack.enter_context(detach(handler))
        self._stack.enter_context(attach(self._handler))
        self._live.start()

    def stop(self) -> None:
        self._live.stop()
        self._stack.close()


class _ConsoleHandler(logging.Handler):
    def __init__(self, console: "Console") -> None:
        super().__init__()
        self._console = console

    def emit(self, record: logging.LogRecord) -> None:
        self._console.print(self.format(record), highlight=False, markup=False)
