"""The progress line of a run, an evaluation, or all jobs of a sweep."""

import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Self

from evoros.evolution.journal import Generation
from evoros.mission.mission import Mission, Outcomes, judge
from evoros.session.screen import Pipe, Screen, fit, open_screen
from evoros.session.status import Display, survey, write_clock
from evoros.storage.layout import FINISHED, RUNNING, folders_below
from evoros.terminal.activity import listen
from evoros.terminal.log import warn_left_out


class _Shown:
    def __init__(self, screen: Screen | None) -> None:
        self._created = time.monotonic()
        self.activity, self.ended = "", False
        self._screen, self._stack = screen, ExitStack()

    def __enter__(self) -> Self:
        self._stack.enter_context(listen(lambda activity: setattr(self, "activity", activity)))
        if self._screen:
            self._screen.start()
            self._stack.callback(self._screen.stop)
        return self

    def __exit__(self, *_: object) -> None:
        self.ended = True
        self._stack.close()

    def _describe_elapsed(self) -> str:
        return f"{write_clock(_elapsed(self._created))} elapsed"


class Progress(_Shown, Display):
    """The progress display of one run or evaluation; a context manager.

    If ``shown``, it is on the terminal, below a notebook cell or, in a pipe, a line every 10 s.
    """

    def __init__(self, shown: bool = True) -> None:
        super().__init__(open_screen(self.line) if shown else None)
        self.since: float | None = None  # [s], time.monotonic() at the first mission
        self.missions, self.simulated = 0, 0.0  # totals of this session
        self.best: float | None = None
        self._mean: float | None = None
        self._generations = self._generation = 0
        self._wanted = self._known = self._done = 0
        self._totals: list[int] = []  # cumulative missions after each generation that ran missions

    def start(self, generations: int) -> None:
        """Set the number of generations."""
        self._generations = generations

    def begin(self, generation: int, missions: int, known: int) -> None:
        """Start a generation of ``missions`` missions, of which ``known`` are already recorded."""
        if self.since is None:
            self.since = time.monotonic()
        # A validation counts as the generation of its design, which may be an earlier generation.
        self._generation = max(self._generation, generation)
        self._wanted, self._known, self._done = missions, known, 0

    def mission(self, mission: Mission, outcomes: Outcomes) -> None:
        """Count a finished mission."""
        self._done += 1
        self.missions += 1
        self.simulated += judge(outcomes).time_s

    def generation(self, generation: Generation) -> None:
        """Update the best and mean fitness after a generation."""
        self.best, self._mean = generation.best.fitness, generation.mean
        if self.missions > sum(self._totals[-1:]):
            self._totals.append(self.missions)

    def line(self, width: int) -> str:
        """Describe the progress or the final result in at most ``width`` characters."""
        elapsed = _elapsed(self.since)
        if self.ended:
            return fit([*self._describe_end(elapsed)], width)
        last = self._generations - 1
        parts = [
            (0, self.activity),
            (1, f"generation {self._generation}/{last}" if last > 0 else ""),
            (3, _best([self.best])),
            (5, "" if self._mean is None else f"mean {self._mean:.3f}"),
            (2, f"missions {self._known + self._done}/{self._wanted}" if self._wanted else ""),
            (6, _speed(self.simulated, elapsed) if self.missions else ""),
            (4, self._describe_time(elapsed)),
        ]
        return fit(parts, width)

    def _describe_end(self, elapsed: float) -> Iterator[tuple[int, str]]:
        yield 0, f"ended after {write_clock(_elapsed(self._created))}"
        yield 1, _best([self.best])
        yield 2, f"missions {self.missions}" if self.missions else ""
        yield 3, _speed(self.simulated, elapsed) if self.missions else ""

    def _describe_time(self, elapsed: float) -> str:
        if self.missions:
            return f"{write_clock(self._left() * elapsed / self.missions)} left"
        return self._describe_elapsed()

    @property
    def share(self) -> float:
        """The estimated fraction of this session's missions that have finished."""
        if self.ended:
            return 1.0
        return self.missions / (self.missions + self._left()) if self.missions else 0.0

    def _left(self) -> float:
        current = max(0, self._wanted - self._known - self._done)
        later = self._totals[-1] / len(self._totals) if self._totals else self._wanted
        return current + later * max(0, self._generations - 1 - self._generation)


class SweepProgress(_Shown):
    """A one-line progress display for a sweep of ``jobs`` jobs."""

    def __init__(self, jobs: int, shown: bool = True) -> None:
        super().__init__(open_screen(self.line) if shown else None)
        self._jobs, self._begun, self._skipped = jobs, list[Progress](), 0

    def job(self) -> Progress:
        """Return the display of the next job."""
        self._begun.append(Progress(shown=False))
        return self._begun[-1]

    def skip(self) -> None:
        """Count a job that is already complete or that cannot start."""
        self._skipped += 1

    @contextmanager
    def pause(self) -> Iterator[None]:
        """Hide the line while results are printed."""
        if self._screen:
            self._screen.stop()
        try:
            yield
        finally:
            if self._screen:
                self._screen.start()

    def line(self, width: int) -> str:
        """Describe the progress of the sweep in at most ``width`` characters."""
        begun = list(self._begun)
        elapsed = _elapsed(min((job.since for job in begun if job.since is not None), default=None))
        running = [job for job in begun if not job.ended]
        share = sum(job.share for job in begun)
        left = ((self._jobs - self._skipped) / share - 1) * elapsed if share else 0.0
        activities = dict.fromkeys([self.activity, *(job.activity for job in running)])
        parts = [
            (0, f"{len(begun) - len(running) + self._skipped} of {self._jobs} done"),
            (4, f"{len(running)} running" if running else ""),
            (2, ", ".join(filter(None, activities))),
            (3, _best(job.best for job in begun)),
            (5, f"missions {sum(job.missions for job in begun)}" if share else ""),
            (6, _speed(sum(job.simulated for job in begun), elapsed) if share else ""),
            (1, f"{write_clock(left)} left" if share else self._describe_elapsed()),
        ]
        return fit(parts, width)


class RecordedProgress(_Shown):
    """The progress of jobs in other processes or on other machines, read from their run folders."""

    def __init__(self, sweep: Path, jobs: int | None) -> None:
        # Jobs may write to this terminal at any time, so print each update on a new line.
        super().__init__(Screen(self.line, Pipe()))
        self._sweep, self._jobs = sweep, jobs

    def line(self, width: int) -> str:
        """Describe the progress of all jobs in at most ``width`` characters."""
        begun = [survey(folder) for folder in folders_below(self._sweep, warn_left_out)]
        states = [job.state for job in begun]
        of_all = "" if self._jobs is None else f" of {self._jobs}"
        parts = [
            (0, f"{states.count(FINISHED)}{of_all} done"),
            (2, f"{states.count(RUNNING)} running"),
            (1, _best(job.best for job in begun)),
            (3, f"missions {sum(job.missions for job in begun)}"),
            (4, self._describe_elapsed()),
        ]
        return fit(parts, width)


def _best(fitness: Iterable[float | None]) -> str:
    known = [value for value in fitness if value is not None]
    return f"best {max(known):.3f}" if known else ""


def _elapsed(since: float | None) -> float:
    return 0.0 if since is None else time.monotonic() - since


def _speed(simulated: float, elapsed: float) -> str:
    return f"{simulated / elapsed if elapsed > 0 else 0.0:.0f} simulated s/s"
