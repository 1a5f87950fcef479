"""Runs the jobs of a sweep, several at the same time, in one pool of workers.

While one job ranks designs or waits for the disk, missions of other jobs keep the workers busy.
Jobs are built in the main thread, because ``${hydra:...}`` refers to global state.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, closing, contextmanager, suppress
from functools import partial
from pathlib import Path
from threading import Lock

from evoros.analysis.run_figures import check_figures, draw_figure
from evoros.base.errors import EvorosError, InputError, RunStopped, override, shell_line
from evoros.cli.checking import check_jobs, warn_of_few_seeds
from evoros.cli.reporting import (
    WORST_FIRST,
    Interrupts,
    JobResult,
    explain_end,
    judge_result,
    report_result,
)
from evoros.cli.status import format_jobs
from evoros.config.jobs import SWEEPER, Job, Jobs
from evoros.executor.protocol import KEPT, BatchPool, Executor, Pool
from evoros.observers.protocol import FREE
from evoros.session.controls import has_controls
from evoros.session.controls import run as run_with_controls
from evoros.session.progress import RecordedProgress, SweepProgress
from evoros.session.run import Session, create_run, open_run, reopen_run
from evoros.session.status import NoDisplay, survey
from evoros.session.work import open_pool
from evoros.storage.layout import MISSIONS, folders_below
from evoros.terminal import console
from evoros.terminal.log import LOGGER, log_everything, log_for_job, log_to_terminal, warn_left_out

MAX_THREADS = 1000  # maximum number of simultaneous jobs; more than any number of workers requires


def jobs_at_once(workers: int) -> int:
    """Return the number of simultaneous jobs that keep all workers busy."""
    return 1 if workers == 1 else 2 + workers // 4


JOBS_TOGETHER = KEPT  # number of jobs that run missions together; workers cache their experiments


class SharedPool:
    """A pool shared by all running jobs, started when the first job opens it."""

    def __init__(self, executor: Executor | None = None) -> None:
        self.executor = executor
        self._pool: Pool | None = None
        self._lock = Lock()
        self._stack = ExitStack()
        self._stopping = False

    @contextmanager
    def open(self, executor: Executor) -> Iterator[Pool]:
        """Replace ``Executor.open``; raise KeyboardInterrupt once ``close`` has been called."""
        try:
            yield self.start(executor)
        except Exception:
            if self._stopping:  # the pool cancelled or rejected the job's calls
                raise KeyboardInterrupt from None
            raise

    @property
    def jobs(self) -> int:
        """The number of simultaneous jobs; 1 until the pool is started."""
        if isinstance(self._pool, BatchPool):
            return JOBS_TOGETHER
        return 1 if self._pool is None else jobs_at_once(self._pool.workers)

    def start(self, executor: Executor) -> Pool:
        """Start the pool if it is not running; raise the errors of ``Executor.open``."""
        with self._lock:
            if self._stopping:
                raise KeyboardInterrupt
            if self._pool is None:
                self._pool = self._stack.enter_context(open_pool(executor))
            return self._pool

    def close(self) -> None:
        """End the workers, and interrupt the jobs that wait for them."""
        self._stopping = True
        with self._lock:
            self._stack.close()


class Sweep:
    """Starts jobs, waits for them, and reports their results, all in the main thread.

    ``build`` returns None for a complete job; ``explain`` converts a job's exception to a result.
    """

    def __init__(
        self,
        build: Callable[[Job], Session | None],
        explain: Callable[[Path, BaseException], JobResult],
        report: Callable[[Path, JobResult], object],
        display: SweepProgress,
    ) -> None:
        self._build, self._explain, self._report = build, explain, report
        self._display = display
        self._pool = SharedPool()
        self._threads = ThreadPoolExecutor(MAX_THREADS)
        self._running: dict[Future[JobResult], Path] = {}
        self.results: list[tuple[Path, JobResult]] = []  # one per job that has ended

    def begin(self, job: Job) -> None:
        """Wait until the pool allows another job, then build and start the job."""
        folder = job.folder
        self._wait(self._pool.jobs - 1)
        try:
            with log_for_job(str(folder)):
                session = self._build(job)
            if session is None:
                LOGGER.info("%s: already complete; left unchanged", folder)
                self.skip(folder, JobResult(console.DONE, kept=True))
                return
            self._use_executor(session.executor)
            LOGGER.info("%s: started", folder)
            if self._pool.jobs != 1:
                self._running[self._threads.submit(self._run, folder, session)] = folder
                return
            result = self._run(folder, session)  # no thread, so that a debugger can be used
        except (KeyboardInterrupt, Exception) as error:
            result = self._explain(folder, error)
            self.skip(folder, result)
            self._report(folder, result)
            if isinstance(error, KeyboardInterrupt):
                raise
            return
        self._conclude(folder, result)

    def skip(self, folder: Path, result: JobResult) -> None:
        """Count a job that was already complete or that could not start."""
        self.results.append((folder, result))
        self._display.skip()

    def finish(self) -> None:
        """Wait for all jobs; after an interrupt, jobs continue until ``close``."""
        self._wait(0)

    def close(self) -> None:
        """Stop the running jobs and end the workers."""
        self._pool.close()
        self._wait(0)
        self._threads.shutdown()

    def _use_executor(self, executor: Executor) -> None:
        if executor != self._pool.executor:  # two pools at once would compete for cores
            self._wait(0)
            self._pool.close()
            self._pool = SharedPool(executor)
        with suppress(EvorosError):  # the job will retry and report the error
            self._pool.start(executor)

    def _run(self, folder: Path, session: Session) -> JobResult:
        with log_for_job(str(folder)), self._display.job() as display:
            try:
                run_with_controls(session, display, draw_figure, self._pool.open)
            except (KeyboardInterrupt, Exception) as error:
                return self._explain(folder, error)
        return JobResult(console.DONE)

    def _wait(self, count: int) -> None:
        while len(self._running) > count:
            for future in wait(self._running, return_when=FIRST_COMPLETED).done:
                self._conclude(self._running[future], future.result())
                del self._running[future]  # last, so that a signal cannot suppress the report

    def _conclude(self, folder: Path, result: JobResult) -> None:
        self.results.append((folder, result))
        with self._display.pause():
            self._report(folder, result)


def run_job(
    build: Callable[[Job], Session | None],
    explain: Callable[[Path, BaseException], JobResult],
    job: Job,
) -> float:
    """Run a job in this process; return its validated or, if there is none, its best fitness."""
    with log_to_terminal(again=True), log_everything(), log_for_job(str(job.folder)):
        try:
            session = build(job)
            if session is not None:
                run_with_controls(session, NoDisplay(), draw_figure)
        except Exception as error:
            with suppress(OSError):  # removes the folder created by Hydra only if empty
                job.folder.rmdir()
            result = explain(job.folder, error)
            kind = InputError if isinstance(error, InputError) else RunStopped
            raise kind(result.message) from None
    overview = survey(job.folder)
    fitness = overview.best if overview.validated is None else overview.validated
    assert fitness is not None, "a finished run has a best individual"
    return fitness


def run_sweep(command: str, jobs: Jobs, config_dir: str | None, interrupts: Interrupts) -> int:
    """Run all jobs of a sweep in one pool, and return the worst exit status."""
    build = partial(build_job, config_dir)
    explain = partial(explain_end, config_dir, interrupts)
    report = partial(report_result, command, True)
    with log_everything(), SweepProgress(len(jobs)) as display:
        ready = check_jobs(command, jobs, explain)
        if not ready:
            return console.INPUT
        warn_of_few_seeds(ready)
        sweep = Sweep(build, explain, report, display)
        begun = begin_all(ready, sweep, interrupts)
    statuses = [] if interrupts.last is None else [interrupts.explain()[1]]
    if begun < len(jobs):
        statuses.append(console.STOPPED)
    return _conclude(command, jobs, sweep.results, statuses)


def run_by_plugins(command: str, jobs: Jobs, config_dir: str | None, interrupts: Interrupts) -> int:
    """Run jobs with the configured Hydra launcher and sweeper; return the worst exit status."""
    from evoros.config.launching import launch, search

    assert jobs.sweep is not None
    searches = SWEEPER in jobs.plugins  # sweepers choose jobs based on earlier results
    explain = partial(explain_end, config_dir, Interrupts())
    run = partial(run_job, partial(build_job, config_dir), explain)
    ready = [] if searches else check_jobs(command, jobs, explain)
    if not searches and not ready:
        return console.INPUT
    errors: dict[Path, EvorosError | None]
    try:
        with log_everything(), RecordedProgress(jobs.sweep, len(ready) or None):
            for plugin, name in jobs.plugins.items():
                LOGGER.info("%s: hydra/%s=%s starts the jobs", jobs.sweep, plugin, name)
            if searches:
                search(jobs, run)
                errors = dict.fromkeys(folders_below(jobs.sweep, warn_left_out))
            else:
                errors = launch(jobs, ready, run)
    except (KeyboardInterrupt, RunStopped):
        _explain_repeating(command, jobs)
        raise
    results = [(folder, JobResult(console.DONE)) for folder in errors if errors[folder] is None]
    for folder, error in errors.items():
        if error is not None:
            result = JobResult(console.status_of(error), str(error))
            report_result(command, True, folder, result)
            results.append((folder, result))
    return _conclude(command, jobs, results, [])


def _conclude(
    command: str, jobs: Jobs, results: Sequence[tuple[Path, JobResult]], others: Sequence[int]
) -> int:
    console.print_result(format_jobs(results))
    statuses = [console.DONE, *others, *(judge_result(*result) for result in results)]
    if console.STOPPED in statuses or console.INTERRUPTED in statuses:
        _explain_repeating(command, jobs)
    return next(status for status in WORST_FIRST if status in statuses)


def _explain_repeating(command: str, jobs: Jobs) -> None:
    LOGGER.error(
        "%s: to continue the unfinished jobs, repeat the command with %s; finished jobs are not "
        "repeated",
        *(command, shell_line(override("hydra.sweep.dir", str(jobs.sweep)))),
    )


def build_job(config_dir: str | None, job: Job) -> Session | None:
    """Build or resume a job; return None if it is complete."""
    if not (job.folder / MISSIONS).exists():
        check_figures(job.config.values)
        return create_run(job.config, job.folder)
    free = tuple(f"{key}{sign}" for key in FREE for sign in "=.")
    typed = [text for text in job.overrides if text.startswith(free)]
    session = reopen_run(job.config, job.folder, typed, config_dir)
    if session is None and job.config.values.get("controls") and not has_controls(job.folder):
        added = [text for text in typed if not text.startswith("stop_after")]  # no search goes on
        return open_run(job.folder, added, config_dir)
    return session


def begin_all(jobs: Iterable[Job], sweep: Sweep, interrupts: Interrupts) -> int:
    """Start jobs until a signal arrives, wait for them, and return the number of started jobs."""
    begun = 0
    with closing(sweep), suppress(KeyboardInterrupt):  # each job reports its resume command
        for job in jobs:
            sweep.begin(job)  # blocks while enough jobs are running
            begun += 1
            if interrupts.last is not None:
                break
        sweep.finish()
    return begun
