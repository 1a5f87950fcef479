"""The live line of a run on a terminal."""

import logging
import sys
import time
from types import TracebackType
from typing import TYPE_CHECKING, Self

from evoros.evolution import Generation
from evoros.log import LOGGER
from evoros.mission import Mission
from evoros.outcome import Outcome

if TYPE_CHECKING:
    from rich.console import Console


class Progress:
    """A display of a run and a context manager; shows nothing unless it is ``live``."""

    def __init__(self, live: bool) -> None:
        self._live = _LiveLine() if live else None
        self._since = time.monotonic()
        self._generations = self._generation = 0
        self._wanted = self._known = self._flown = 0
        self._simulated = 0.0
        self._all = 0  # missions flown in this session
        self._finished: list[int] = []  # missions flown by the end of each generation that flew any
        self._standing = ""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
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
        self._show()

    def mission(self, mission: Mission, outcome: Outcome) -> None:
        """A mission was flown."""
        self._flown += 1
        self._all += 1
        self._simulated += outcome.time_s
        self._show()

    def generation(self, generation: Generation) -> None:
        """A generation is over."""
        self._standing = f"best {generation.best.fitness:.3f}, mean {generation.mean:.3f}"
        if self._all > sum(self._finished[-1:]):
            self._finished.append(self._all)

    def _show(self) -> None:
        if self._live:
            self._live.show(self.line())

    def line(self) -> str:
        """Where the run is, in one line."""
        elapsed = time.monotonic() - self._since
        pace = self._simulated / elapsed if elapsed > 0 else 0.0
        done = self._known + self._flown
        parts = [
            f"generation {self._generation}/{last}" if (last := self._generations - 1) else "",
            self._standing,
            f"missions {done}/{self._wanted}",
            f"{pace:.0f} simulated s/s",
            f"{_clock(self._left() * elapsed / self._all)} left" if self._all else "",
        ]
        return " | ".join(part for part in parts if part)

    def _left(self) -> float:
        """Missions left, as if the generations to come needed as many as those of this session."""
        now = self._wanted - self._known - self._flown
        each = self._finished[-1] / len(self._finished) if self._finished else self._wanted
        return now + each * (self._generations - 1 - self._generation)


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}"


class _LiveLine:
    """One line at the bottom of the terminal; log lines scroll above it."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.live import Live
        from rich.text import Text

        self._text = Text
        console = Console(stderr=True)
        self._live = Live(console=console, refresh_per_second=4, transient=True)
        self._handler: logging.Handler = _ConsoleHandler(console)
        self._replaced: list[logging.Handler] = []

    def start(self) -> None:
        self._replaced = [
            handler
            for handler in LOGGER.handlers
            if isinstance(handler, logging.StreamHandler) and handler.stream is sys.stderr
        ]
        for handler in self._replaced:
            LOGGER.removeHandler(handler)
        LOGGER.addHandler(self._handler)
        self._live.start()

    def show(self, line: str) -> None:
        self._live.update(self._text(line))

    def stop(self) -> None:
        self._live.stop()
        LOGGER.removeHandler(self._handler)
        for handler in self._replaced:
            LOGGER.addHandler(handler)
        self._replaced = []


class _ConsoleHandler(logging.Handler):
    def __init__(self, console: "Console") -> None:
        super().__init__(logging.INFO)
        self._console = console

    def emit(self, record: logging.LogRecord) -> None:
        self._console.print(self.format(record), highlight=False, markup=False)
