"""What ``evoros`` and ``evoros-evaluate`` share: arguments, messages and exit statuses.

Exit statuses: 0 done; 1 stopped, resumable; 2 input that cannot be used; 130 interrupted.
"""

import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from evoros import __version__
from evoros.base.console import DONE, INPUT, INTERRUPTED, STOPPED, print_result
from evoros.base.errors import EvorosError, InputError, RunStopped, single_line
from evoros.base.log import LOGGER, log_to_terminal
from evoros.cli.signals import Signals

if TYPE_CHECKING:
    from evoros.cli.sweep import JobResult, Sweep
    from evoros.config.configuration import Configuration
    from evoros.config.jobs import Job, Jobs
    from evoros.config.options import Options
    from evoros.session.work import Work

WORST_FIRST = (INTERRUPTED, INPUT, STOPPED, DONE)
"""Exit statuses, the worst first: a sweep ends with the worst of its jobs."""


@dataclass(frozen=True)
class Command:
    """One console command. Calling it runs the command and returns its exit status.

    Its functions import what they need when they are called, so that the first message is quick.
    """

    name: str
    primary: str  # its own file of conf/, into which everything else is composed
    create: "Callable[[Configuration, Path], Work]"
    open: "Callable[[Path, Sequence[str], str | None], Work]"
    reopen: "Callable[[Configuration, Path, Sequence[str], str | None], Work | None]"
    """Opens the folder of a job of a sweep that is typed again; None if it is complete."""
    summarize: Callable[[Path], str]  # the result that is printed when a folder is finished

    def __call__(self, arguments: Sequence[str]) -> int:
        """Run the command and return its exit status."""
        with log_to_terminal(), Signals() as signals:
            try:
                return _execute(self, list(arguments), signals)
            except KeyboardInterrupt:
                return _report(self, *signals.explain())
            except EvorosError as error:
                return _report(self, str(error), _status(error))


def _execute(command: Command, arguments: list[str], signals: Signals) -> int:
    from evoros.config.options import parse_options

    options = parse_options(arguments)
    if options.version:
        print(f"{command.name} {__version__}")
        return DONE
    if options.config_dir:
        from evoros.config.compose import add_config_dir

        add_config_dir(options.config_dir)
    if any(override.startswith("resume=") for override in options.overrides):
        if options.shows or options.multirun:
            raise InputError("resume=: goes with --config-dir only; leave the other options out")
        return _resume(command, options, signals)
    if options.shows:
        from evoros.config.help import show

        return show(command.name, command.primary, arguments)
    return _start(command, options, signals)


def _resume(command: Command, options: "Options", signals: Signals) -> int:
    """Go on with the work in the folder of ``resume=FOLDER``."""
    target = next(text for text in options.overrides if text.startswith("resume="))
    folder = Path(target.partition("=")[2]).expanduser()
    overrides = [text for text in options.overrides if text is not target]
    build = partial(command.open, folder, overrides, options.config_dir)
    return _run_alone(command, build, folder, options.config_dir, signals)


def _start(command: Command, options: "Options", signals: Signals) -> int:
    """Start one job, or the jobs of a sweep."""
    from evoros.config.jobs import Job, Jobs

    jobs = Jobs(options.overrides, options.multirun, options.config_dir, command.primary)
    if jobs.sweep is not None:
        return _run_sweep(command, jobs, options.config_dir, signals)
    (job,) = (job for job in jobs if isinstance(job, Job))
    build = partial(command.create, job.config, job.folder)
    return _run_alone(command, build, job.folder, options.config_dir, signals)


def _run_alone(
    command: Command,
    build: "Callable[[], Work]",
    folder: Path,
    config_dir: str | None,
    signals: Signals,
) -> int:
    """Build and run the only job, report its result and return the exit status."""
    from evoros.cli.progress import Progress
    from evoros.cli.sweep import JobResult

    result = JobResult(DONE)
    try:
        with Progress(sys.stderr.isatty()) as display:
            build().run(display)
    except (KeyboardInterrupt, Exception) as error:
        result = _explain(config_dir, signals, folder, error)
    return _report_result(command, False, folder, result)


def _run_sweep(command: Command, jobs: "Jobs", config_dir: str | None, signals: Signals) -> int:
    """Run all jobs of a sweep and return the worst exit status."""
    from evoros.base.log import log_everything
    from evoros.cli.job_table import format_jobs
    from evoros.cli.progress import SweepProgress
    from evoros.cli.sweep import Sweep

    build = partial(_build, command, config_dir)
    explain = partial(_explain, config_dir, signals)
    report = partial(_report_result, command, True)
    with log_everything(), SweepProgress(sys.stderr.isatty(), len(jobs)) as display:
        sweep = Sweep(build, explain, report, display)
        begun = _begin_all(command, jobs, sweep, signals)
    print_result(format_jobs(sweep.results))
    statuses = [DONE, *(result.status for _, result in sweep.results)]
    if signals.last is not None:
        statuses.append(signals.explain()[1])
    if begun < len(jobs) or STOPPED in statuses or INTERRUPTED in statuses:
        LOGGER.error(
            "%s: to go on with the jobs that are not finished, repeat the command with "
            "hydra.sweep.dir=%s; it keeps what is complete",
            command.name,
            shlex.quote(str(jobs.sweep)),
        )
    return next(status for status in WORST_FIRST if status in statuses)


def _build(command: Command, config_dir: str | None, job: "Job") -> "Work | None":
    """Build a job, or go on with it if its folder has been made; None if it is complete."""
    from evoros.storage.layout import MISSIONS

    if not (job.folder / MISSIONS).exists():
        return command.create(job.config, job.folder)
    executor = [text for text in job.overrides if text.startswith(("executor=", "executor."))]
    return command.reopen(job.config, job.folder, executor, config_dir)


def _begin_all(command: Command, jobs: "Jobs", sweep: "Sweep", signals: Signals) -> int:
    """Begin jobs until a signal comes, wait for them to end, and return how many began."""
    from evoros.cli.sweep import JobResult
    from evoros.config.jobs import RefusedJob

    begun = 0
    try:
        for job in jobs:
            if isinstance(job, RefusedJob):
                status = _report(command, str(job.error), _status(job.error))
                sweep.skip(job.folder, JobResult(status, str(job.error)))
            else:
                sweep.begin(job)  # blocks until another job has ended if enough are running
            begun += 1
            if signals.last is not None:
                break
        sweep.finish()
    except KeyboardInterrupt:  # each job that it stops reports how to resume it
        pass
    finally:
        sweep.close()
    return begun


def _explain(
    config_dir: str | None, signals: Signals, folder: Path, error: BaseException
) -> "JobResult":
    """The result of a job that raised, with the command that resumes it."""
    from evoros.cli.sweep import JobResult
    from evoros.storage.layout import LOG

    hint = _resume_hint(folder, config_dir)
    if isinstance(error, KeyboardInterrupt):
        message, status = signals.explain()
        return JobResult(status, message + hint)
    if isinstance(error, EvorosError):
        return JobResult(_status(error), f"{error}{hint if isinstance(error, RunStopped) else ''}")
    # An error in the user's own part, a full disk, or a bug of evoros.
    message = single_line(f"{type(error).__name__}: {error}")
    log = folder / LOG
    traceback = f" (traceback in {log})" if log.exists() else ""
    return JobResult(STOPPED, f"{message}{traceback}{hint}")


def _resume_hint(folder: Path, config_dir: str | None) -> str:
    """What to type to go on; empty if the folder has not been made."""
    from evoros.storage.layout import MISSIONS, resume_command

    if not (folder / MISSIONS).exists():
        return ""
    option = f" --config-dir {shlex.quote(config_dir)}" if config_dir else ""
    return f"; to continue type: {resume_command(folder)}{option}"


def _report_result(command: Command, in_sweep: bool, folder: Path, result: "JobResult") -> int:
    """Print the summary of a finished job, or report why it ended; returns its exit status."""
    if result.message:
        name = f"{folder.name}: " if in_sweep else ""
        return _report(command, f"{name}{result.message}", result.status)
    print_result(command.summarize(folder))
    return result.status


def _report(command: Command, message: str, status: int) -> int:
    LOGGER.error("%s: %s", command.name, single_line(message))
    return status


def _status(error: EvorosError) -> int:
    return INPUT if isinstance(error, InputError) else STOPPED
