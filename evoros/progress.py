"""What a run shows: a live display on a terminal, a line a generation elsewhere."""

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from evoros.experiment import Experiment, Generation
from evoros.mission import Mission
from evoros.outcome import Outcome
from evoros.record import LOG

LOGGER = logging.getLogger("evoros")


class Progress:
    """Logs a line for each generation and, on a terminal, keeps a live line below them."""

    def __init__(self, live: bool) -> None:
        self._live = _LiveLine() if live else None
        self._since = time.monotonic()
        self._generations = self._generation = 0
        self._wanted = self._known = self._flown = 0
        self._simulated = 0.0
        self._worked = 0  # generations that needed missions in this session
        self._standing = ""

    def start(self, folder: Path, experiment: Experiment, generations: int) -> None:
        """Say what runs where; from now on the log goes into the folder, too."""
        handler = logging.FileHandler(folder / LOG)
        handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
        LOGGER.addHandler(handler)
        self._since, self._generations = time.monotonic(), generations
        LOGGER.info(
            "%s: %d generations, seed %d, worlds %s, %d workers",
            folder,
            generations,
            experiment.seed,
            ", ".join(experiment.world),
            experiment.executor.workers,
        )
        if self._live:
            self._live.start()

    def begin(self, generation: int, missions: int, known: int) -> None:
        """Missions are wanted."""
        if missions > known:
            self._worked += generation != self._generation or not self._worked
        self._generation, self._wanted, self._known, self._flown = generation, missions, known, 0
        self._show()

    def mission(self, mission: Mission, outcome: Outcome) -> None:
        """A mission was flown."""
        self._flown += 1
        self._simulated += outcome.time_s
        if outcome.reason:
            LOGGER.warning(
                "design %d in %s: %s: %s",
                mission.design_id,
                mission.world,
                outcome.ended,
                outcome.reason,
            )
        self._show()

    def generation(self, generation: Generation) -> None:
        """A generation is over."""
        validated = (
            "" if generation.validated is None else f", validated {generation.validated:.3f}"
        )
        self._standing = (
            f"best {generation.best.fitness:.3f}{validated}, mean {generation.mean:.3f}"
        )
        last = self._generations - 1
        LOGGER.info("generation %d/%d: %s", generation.number, last, self._standing)

    def close(self) -> None:
        """End the live line and the log file."""
        if self._live:
            self._live.stop()
        for handler in list(LOGGER.handlers):
            if isinstance(handler, logging.FileHandler):
                LOGGER.removeHandler(handler)
                handler.close()

    def _show(self) -> None:
        if self._live:
            self._live.show(self.line())

    def line(self) -> str:
        """Where the run is, in one line."""
        elapsed = time.monotonic() - self._since
        pace = self._simulated / elapsed if elapsed > 0 else 0.0
        done = self._known + self._flown
        parts = [
            f"generation {self._generation}/{self._generations - 1}",
            self._standing,
            f"missions {done}/{self._wanted}",
            f"{pace:.0f} simulated s/s",
            f"{_clock(self._left(elapsed))} left" if self._worked else "",
        ]
        return " | ".join(part for part in parts if part)

    def _left(self, elapsed: float) -> float:
        """Seconds left, as if the generations to come took as long as those of this session."""
        share = (self._known + self._flown) / self._wanted if self._wanted else 1.0
        done = self._worked - 1 + share
        return elapsed / done * (self._generations - self._generation - share) if done else 0.0


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

    def start(self) -> None:
        self._replaced = [h for h in LOGGER.handlers if type(h) is logging.StreamHandler]
        for handler in self._replaced:
            LOGGER.removeHandler(handler)
        LOGGER.addHandler(self._handler)
        self._live.start()

    def show(self, line: str) -> None:
        self._live.update(self._text(line, overflow="ellipsis", no_wrap=True))

    def stop(self) -> None:
        if self._live.is_started:
            self._live.stop()
            LOGGER.removeHandler(self._handler)
            for handler in self._replaced:
                LOGGER.addHandler(handler)


class _ConsoleHandler(logging.Handler):
    def __init__(self, console: object) -> None:
        super().__init__(logging.INFO)
        self._console = console

    def emit(self, record: logging.LogRecord) -> None:
        self._console.print(self.format(record), highlight=False, markup=False)  # type: ignore[attr-defined]


@contextmanager
def logging_to_terminal() -> Iterator[None]:
    """Messages go to standard error; results alone go to standard output."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(logging.Formatter("%(message)s"))
    LOGGER.addHandler(handler)
    LOGGER.setLevel(logging.INFO)
    LOGGER.propagate = False
    try:
        yield
    finally:
        LOGGER.removeHandler(handler)
