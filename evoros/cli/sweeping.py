"""Sweeps of a command: by evoros itself, or by the launchers and sweepers of Hydra."""

import shlex
from collections.abc import Sequence
from contextlib import closing, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from evoros.base.errors import EvorosError, RunStopped
from evoros.cli.interrupts import Interrupts
from evoros.cli.reporting import WORST_FIRST, JobResult, explain_end, judge_result, report_result
from evoros.cli.sweep import Sweep
from evoros.terminal.console import (
    DONE,
    INTERRUPTED,
    STOPPED,
    print_result,
    report_error,
    status_of,
)
from evoros.terminal.log import LOGGER, log_everything, warn_left_out

if TYPE_CHECKING:
    from collections.abc import Iterable

    from evoros.cli.kind import Kind
    from evoros.config.jobs import Job, Jobs, RefusedJob
    from evoros.session.work import Work


def run_sweep(kind: "Kind", jobs: "Jobs", config_dir: str | None, interrupts: Interrupts) -> int:
    """Run all jobs of a sweep in one pool, and return the worst exit status."""
    from evoros.session.progress import SweepProgress

    build = partial(build_job, kind, config_dir)
    explain = partial(explain_end, config_dir, interrupts)
    report = partial(report_result, kind, True)
    with log_everything(), SweepProgress(len(jobs)) as display:
        sweep = Sweep(build, explain, report, display)
        begun = begin_all(kind.name, jobs, sweep, interrupts)
    statuses = [] if interrupts.last is None else [interrupts.explain()[1]]
    if begun < len(jobs):
        statuses.append(STOPPED)
    return _conclude(kind, jobs, sweep.results, statuses)


def run_by_plugins(
    kind: "Kind", jobs: "Jobs", config_dir: str | None, interrupts: Interrupts
) -> int:
    """Let the chosen launcher and sweeper of Hydra run jobs; returns the worst exit status."""
    from evoros.cli.launched import JobRunner
    from evoros.config.jobs import SWEEPER
    from evoros.config.launching import launch, search
    from evoros.session.progress import RecordedProgress
    from evoros.storage.discovery import folders_below

    assert jobs.sweep is not None
    count = None if SWEEPER in jobs.plugins else len(jobs)
    run = JobRunner(
        partial(build_job, kind, config_dir), partial(explain_end, config_dir, Interrupts())
    )
    errors: dict[Path, EvorosError | None]
    try:
        with log_everything(), RecordedProgress(jobs.sweep, count):
            for plugin, name in jobs.plugins.items():
                LOGGER.info("%s: hydra/%s=%s starts the jobs", jobs.sweep, plugin, name)
            if SWEEPER in jobs.plugins:
                search(jobs, run)
                errors = dict.fromkeys(folders_below(jobs.sweep, warn_left_out))
            else:
                errors = launch(jobs, run)
    except (KeyboardInterrupt, RunStopped):
        _explain_repeating(kind, jobs)
        raise
    results = []
    for folder, error in errors.items():
        result = JobResult(DONE)
        if error is not None:
            status = report_error(kind.name, f"{folder.name}: {error}", status_of(error))
            result = JobResult(status, str(error))
        results.append((folder, result))
    return _conclude(kind, jobs, results, [])


def _conclude(
    kind: "Kind", jobs: "Jobs", results: Sequence[tuple[Path, JobResult]], others: Sequence[int]
) -> int:
    """Print the table of a sweep and how to go on; return the worst exit status."""
    from evoros.cli.job_table import format_jobs

    print_result(format_jobs(results))
    statuses = [DONE, *others, *(judge_result(kind, *result) for result in results)]
    if STOPPED in statuses or INTERRUPTED in statuses:
        _explain_repeating(kind, jobs)
    return next(status for status in WORST_FIRST if status in statuses)


def _explain_repeating(kind: "Kind", jobs: "Jobs") -> None:
    LOGGER.error(
        "%s: to go on with the jobs that are not finished, repeat the command with "
        "hydra.sweep.dir=%s; it keeps what is complete",
        *(kind.name, shlex.quote(str(jobs.sweep))),
    )


def build_job(kind: "Kind", config_dir: str | None, job: "Job") -> "Work | None":
    """Build a job, or go on with it if its folder has been made; None if it is complete."""
    from evoros.observers.protocol import FREE
    from evoros.storage.layout import MISSIONS

    if not (job.folder / MISSIONS).exists():
        return kind.create(job.config, job.folder)
    free = tuple(f"{key}{sign}" for key in FREE for sign in "=.")
    typed = [text for text in job.overrides if text.startswith(free)]
    return kind.load().reopen(job.config, job.folder, typed, config_dir)


def begin_all(
    name: str, jobs: "Iterable[Job | RefusedJob]", sweep: Sweep, interrupts: Interrupts
) -> int:
    """Begin jobs until a signal comes, wait for them to end, and return how many began."""
    from evoros.config.jobs import RefusedJob

    begun = 0
    with closing(sweep), suppress(KeyboardInterrupt):  # each job reports how to resume it
        for job in jobs:
            if isinstance(job, RefusedJob):
                status = report_error(name, str(job.error), status_of(job.error))
                sweep.skip(job.folder, JobResult(status, str(job.error)))
            else:
                sweep.begin(job)  # blocks until another job has ended if enough are running
            begun += 1
            if interrupts.last is not None:
                break
        sweep.finish()
    return begun
