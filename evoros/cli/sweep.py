"""The jobs of a sweep: several at the same time, all in one pool.

At the end of each generation workers run out of missions while the main process ranks designs and
waits for the disk; the missions of another job fill the gap. Jobs are built one after another in
the main thread, because what ``${hydra:...}`` refers to is global; then each has a thread.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from evoros.base.log import LOGGER, on_behalf_of

if TYPE_CHECKING:
    from omegaconf import DictConfig

    from evoros.cli.progress import SweepProgress
    from evoros.config.jobs import Job
    from evoros.executor.protocol import Executor, Pool
    from evoros.session.run import Work

MOST = 1000
"""More jobs at the same time than any number of workers asks for."""


@dataclass(frozen=True)
class JobResult:
    """How a job ended: its exit status, and what is to be said of it; nothing where it is done."""

    status: int
    said: str = ""


def jobs_at_once(workers: int) -> int:
    """As many as keep the workers busy; with one worker, jobs follow each other."""
    return 1 if workers == 1 else 2 + workers // 4


class SharedPool:
    """The pool of all jobs under way, started when the first of them opens it."""

    def __init__(self, executor: "Executor | None" = None) -> None:
        self.executor = executor
        self._pool: Pool | None = None
        self._lock = Lock()
        self._stack = ExitStack()
        self._stopping = False

    @contextmanager
    def open(self, executor: "Executor") -> "Iterator[Pool]":
        """In place of the executor's own ``open``; a stop is Ctrl-C for all who have it open."""
        try:
            yield self._started(executor)
        except Exception:
            if self._stopping:  # calls were cancelled, and new ones refused
                raise KeyboardInterrupt from None
            raise

    def _started(self, executor: "Executor") -> "Pool":
        with self._lock:
            if self._stopping:
                raise KeyboardInterrupt
            if self._pool is None:
                self._pool = self._stack.enter_context(executor.open())
            return self._pool

    def close(self) -> None:
        """End the workers; whoever still waits for them is stopped."""
        self._stopping = True
        with self._lock:
            self._stack.close()


class Sweep:
    """Jobs under way. Used by the main thread, which alone says how they end.

    ``prepare`` builds a job; ``explain`` makes an ending of the exception that ended it; ``tell``
    says how it ended.
    """

    def __init__(
        self,
        prepare: "Callable[[DictConfig, Path], Work]",
        explain: Callable[[Path, BaseException], JobResult],
        tell: Callable[[Path, JobResult], object],
        display: "SweepProgress",
    ) -> None:
        self._prepare, self._explain, self._tell = prepare, explain, tell
        self._display = display
        self._pool = SharedPool()
        self._threads = ThreadPoolExecutor(MOST)
        self._running: dict[Future[JobResult], Path] = {}
        self.statuses: list[int] = []

    def begin(self, job: "Job") -> None:
        """Build a job and start it, as soon as no more than enough are under way.

        Raises:
            KeyboardInterrupt: that was interrupted; the others go on until ``close``.
        """
        path = job.folder
        self._let_end(jobs_at_once(self._workers) - 1)
        try:
            with on_behalf_of(str(path)):
                work = self._prepare(job.config, path)
            self._share(work.executor)
            LOGGER.info("%s: begins", path)
            if self._workers > 1:
                self._running[self._threads.submit(self._run, path, work)] = path
                return
            ending = self._run(path, work)  # here, where a debugger has the terminal
        except (KeyboardInterrupt, Exception) as error:
            ending = self._explain(path, error)
            self.refuse(ending.status)
            self._tell(path, ending)
            if isinstance(error, KeyboardInterrupt):
                raise
            return
        self._conclude(path, ending)

    def refuse(self, status: int) -> None:
        """A job that could not begin, of which it is said why."""
        self.statuses.append(status)
        with self._display.job():  # which is over at once
            pass

    def finish(self) -> None:
        """Wait for all jobs.

        Raises:
            KeyboardInterrupt: interrupted; they go on until ``close``.
        """
        self._let_end(0)

    def close(self) -> None:
        """Stop what still runs, and end the workers."""
        self._pool.close()
        self._let_end(0)
        self._threads.shutdown()

    @property
    def _workers(self) -> int:
        return self._pool.executor.workers if self._pool.executor else 1

    def _share(self, executor: "Executor") -> None:
        """The one pool is that of this executor: with another, two would compete for the cores."""
        if executor != self._pool.executor:
            self._let_end(0)
            self._pool.close()
            self._pool = SharedPool(executor)

    def _run(self, path: Path, work: "Work") -> JobResult:
        with on_behalf_of(str(path)), self._display.job() as display:
            try:
                work.run(display, self._pool.open)
            except (KeyboardInterrupt, Exception) as error:
                return self._explain(path, error)
        return JobResult(0)

    def _let_end(self, left: int) -> None:
        """Wait until no more than so many jobs are under way."""
        while len(self._running) > left:
            for future in wait(self._running, return_when=FIRST_COMPLETED).done:
                self._conclude(self._running[future], future.result())
                del self._running[future]  # now, so that no signal keeps an ending from being told

    def _conclude(self, path: Path, ending: JobResult) -> None:
        self.statuses.append(ending.status)
        with self._display.paused():
            self._tell(path, ending)
