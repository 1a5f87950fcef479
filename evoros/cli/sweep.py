"""The jobs of a sweep: several run at the same time, all in one pool.

At the end of each generation workers run out of missions while the main process ranks designs and
waits for the disk; the missions of another job fill the gap. Jobs are built one after another in
the main thread, because ``${hydra:...}`` refers to global state; then each has a thread.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

from evoros.analysis.run_figures import draw_figure
from evoros.base.errors import EvorosError
from evoros.cli.reporting import JobResult
from evoros.executor.payload import KEPT
from evoros.executor.protocol import BatchPool
from evoros.terminal.activity import announce
from evoros.terminal.console import DONE
from evoros.terminal.log import LOGGER, log_for_job
from evoros.terminal.unwritable import silence_unwritable

if TYPE_CHECKING:
    from evoros.config.jobs import Job
    from evoros.executor.protocol import Executor, Pool
    from evoros.session.progress import SweepProgress
    from evoros.session.work import Work

MAX_THREADS = 1000
"""More jobs at the same time than any number of workers needs."""


def jobs_at_once(workers: int) -> int:
    """Return the number of jobs that keep the workers busy; one worker has one at a time."""
    return 1 if workers == 1 else 2 + workers // 4


JOBS_TOGETHER = KEPT
"""Jobs whose missions are launched together; a worker keeps as many experiments."""


class SharedPool:
    """The pool of all running jobs, started when the first of them opens it."""

    def __init__(self, executor: "Executor | None" = None) -> None:
        self.executor = executor
        self._pool: Pool | None = None
        self._lock = Lock()
        self._stack = ExitStack()
        self._stopping = False

    @contextmanager
    def open(self, executor: "Executor") -> "Iterator[Pool]":
        """Stand in for the executor's own ``open``.

        Raises:
            KeyboardInterrupt: ``close`` was called, which interrupts all jobs that have it open.
        """
        try:
            yield self.start(executor)
        except Exception:
            if self._stopping:  # calls were cancelled, and new ones refused
                raise KeyboardInterrupt from None
            raise

    @property
    def jobs(self) -> int:
        """The number of jobs that run at the same time; one if it has not been started."""
        if isinstance(self._pool, BatchPool):
            return JOBS_TOGETHER
        return 1 if self._pool is None else jobs_at_once(self._pool.workers)

    def start(self, executor: "Executor") -> "Pool":
        """Start the pool if it has not been started; see ``Executor.open`` for what it raises."""
        with self._lock:
            if self._stopping:
                raise KeyboardInterrupt
            if self._pool is None:
                with announce("starting workers"):
                    silence_unwritable()
                    self._pool = self._stack.enter_context(executor.open())
            return self._pool

    def close(self) -> None:
        """End the workers and interrupt the jobs that still wait for them."""
        self._stopping = True
        with self._lock:
            self._stack.close()


class Sweep:
    """Starts jobs and waits for them. Only the main thread uses it and reports results.

    ``build`` builds a job, or returns None if it is complete; ``explain`` turns the exception that
    ended a job into its result; ``report`` reports a result.
    """

    def __init__(
        self,
        build: "Callable[[Job], Work | None]",
        explain: Callable[[Path, BaseException], JobResult],
        report: Callable[[Path, JobResult], object],
        display: "SweepProgress",
    ) -> None:
        self._build, self._explain, self._report = build, explain, report
        self._display = display
        self._pool = SharedPool()
        self._threads = ThreadPoolExecutor(MAX_THREADS)
        self._running: dict[Future[JobResult], Path] = {}
        self.results: list[tuple[Path, JobResult]] = []  # of the jobs that have ended

    def begin(self, job: "Job") -> None:
        """Build a job and start it, once fewer than the pool's ``jobs`` are running.

        Raises:
            KeyboardInterrupt: it was interrupted; the others go on until ``close``.
        """
        folder = job.folder
        self._wait(self._pool.jobs - 1)
        try:
            with log_for_job(str(folder)):
                work = self._build(job)
            if work is None:
                LOGGER.info("%s: is complete and stays as it is", folder)
                self.skip(folder, JobResult(DONE, kept=True))
                return
            self._use_executor(work.executor)
            LOGGER.info("%s: begins", folder)
            if self._pool.jobs != 1:
                self._running[self._threads.submit(self._run, folder, work)] = folder
                return
            result = self._run(folder, work)  # in this thread, where a debugger has the terminal
        except (KeyboardInterrupt, Exception) as error:
            result = self._explain(folder, error)
            self.skip(folder, result)
            self._report(folder, result)
            if isinstance(error, KeyboardInterrupt):
                raise
            return
        self._conclude(folder, result)

    def skip(self, folder: Path, result: JobResult) -> None:
        """Count a job that does not run: it is complete, or it could not begin."""
        self.results.append((folder, result))
        self._display.skip()

    def finish(self) -> None:
        """Wait for all jobs.

        Raises:
            KeyboardInterrupt: interrupted; the jobs go on until ``close``.
        """
        self._wait(0)

    def close(self) -> None:
        """Stop the jobs that still run, and end the workers."""
        self._pool.close()
        self._wait(0)
        self._threads.shutdown()

    def _use_executor(self, executor: "Executor") -> None:
        """Replace the pool if the executor is another: two pools would compete for the cores."""
        if executor != self._pool.executor:
            self._wait(0)
            self._pool.close()
            self._pool = SharedPool(executor)
        with suppress(EvorosError):  # the job tries again, and ends by the error
            self._pool.start(executor)

    def _run(self, folder: Path, work: "Work") -> JobResult:
        with log_for_job(str(folder)), self._display.job() as display:
            try:
                work.run(display, draw_figure, self._pool.open)
            except (KeyboardInterrupt, Exception) as error:
                return self._explain(folder, error)
        return JobResult(DONE)

    def _wait(self, count: int) -> None:
        """Wait until at most ``count`` jobs are running."""
        while len(self._running) > count:
            for future in wait(self._running, return_when=FIRST_COMPLETED).done:
                self._conclude(self._running[future], future.result())
                del self._running[future]  # last, so that a signal cannot suppress its report

    def _conclude(self, folder: Path, result: JobResult) -> None:
        self.results.append((folder, result))
        with self._display.pause():
            self._report(folder, result)
