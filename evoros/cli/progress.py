"""The live line of a run, or of all runs of a sweep, on a terminal."""

import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Self

from evoros.base.log import LOGGER, attached, detached, for_terminal
from evoros.evolution.journal import Generation
from evoros.mission.mission import Mission
from evoros.mission.outcome import Outcome

if TYPE_CHECKING:
    from rich.console import Console


class Progress:
    """A display of a run and a context manager; shows nothing unless it is ``live``."""

    def __init__(self, live: bool) -> None:
        self._since = time.monotonic()
        self.missions, self.simulated, self.ended = 0, 0.0, False  # in this session
        self._generations = self._generation = 0
        self._wanted = self._known = self._flown = 0
        self._finished: list[int] = []  # missions flown by the end of each generation that flew any
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
        """The run starts."""
        self._since, self._generations = time.monotonic(), generations
        if self._live:
            self._live.start()

    def begin(self, generation: int, missions: int, known: int) -> None:
        """Missions are wanted."""
        self._generation, self._wanted, self._known, self._flown = generation, missions, known, 0

    def mission(self, mission: Mission, outcome: Outcome) -> None:
        """A mission was flown."""
        self._flown += 1
        self.missions += 1
        self.simulated += outcome.time_s

    def generation(self, generation: Generation) -> None:
        """A generation is over."""
        self._standing = f"best {generation.best.fitness:.3f}, mean {generation.mean:.3f}"
        if self.missions > sum(self._finished[-1:]):
            self._finished.append(self.missions)

    def line(self) -> str:
        """Where the run is, in one line."""
        elapsed = time.monotonic() - self._since
        pace = self.simulated / elapsed if elapsed > 0 else 0.0
        done = self._known + self._flown
        parts = [
            f"generation {self._generation}/{last}" if (last := self._generations - 1) else "",
            self._standing,
            f"missions {done}/{self._wanted}",
            f"{pace:.0f} simulated s/s",
            f"{_clock(self._left() * elapsed / self.missions)} left" if self.missions else "",
        ]
        return " | ".join(part for part in parts if part)

    @property
    def share(self) -> float:
        """Of the missions of this session, as far as they can be foreseen, those that are flown."""
        if self.ended:
            return 1.0
        return self.missions / (self.missions + self._left()) if self.missions else 0.0

    def _left(self) -> float:
        """Missions left, as if the generations to come needed as many as those of this session."""
        now = self._wanted - self._known - self._flown
        each = self._finished[-1] / len(self._finished) if self._finished else self._wanted
        return now + each * (self._generations - 1 - self._generation)


class SweepProgress:
    """The same of a sweep of so many jobs: one line for those that run and those that ran."""

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
    def paused(self) -> Iterator[None]:
        """The terminal is free for results."""
        if self._live:
            self._live.stop()
        try:
            yield
        finally:
            if self._live:
                self._live.start()

    def line(self) -> str:
        """Where the sweep is, in one line."""
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
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}"


class _LiveLine:
    """One line at the bottom of the terminal; log lines scroll above it."""

    def __init__(self, line: Callable[[], str]) -> None:
        from rich.console import Console
        from rich.live import Live
        from rich.text import Text

        console = Console(stderr=True)
        # Four times a second the line is asked for, however many missions there are.
        self._live = Live(
            console=console,
            refresh_per_second=4,
            transient=True,
            get_renderable=lambda: Text(line()),
        )
        self._handler = for_terminal(_ConsoleHandler(console))
        self._stack = ExitStack()

    def start(self) -> None:
        for handler in LOGGER.handlers:
            if isinstance(handler, logging.StreamHandler) and handler.stream is sys.stderr:
                self._stack.enter_context(detached(handler))
        self._stack.enter_context(attached(self._handler))
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
