"""The parts that ``evoros`` and ``evoros-evaluate`` share: arguments, messages, exit statuses.

Exit statuses: 0 done; 1 stopped, resumable; 2 input that cannot be used; 130 interrupted.
"""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from evoros.analysis.run_figures import draw_figure
from evoros.base.errors import InputError
from evoros.cli.interrupts import Interrupts
from evoros.cli.kind import Kind
from evoros.cli.reporting import JobResult, explain_end, report_result
from evoros.files.origin import read_origin
from evoros.files.resources import expand_home
from evoros.terminal.console import DONE, print_result, report_errors

if TYPE_CHECKING:
    from evoros.config.options import Options
    from evoros.session.work import Work


class Command(Kind):
    """A console command. Calling it runs the command and returns its exit status."""

    def __call__(self, arguments: Sequence[str]) -> int:
        """Run the command and return its exit status."""
        with Interrupts() as interrupts:
            run = partial(_execute, self, list(arguments), interrupts)
            return report_errors(self.name, run, interrupts.explain)


def _execute(command: Command, arguments: list[str], interrupts: Interrupts) -> int:
    from evoros.config.options import parse_options

    options = parse_options(arguments)
    if options.version:
        print_result(f"{command.name} {read_origin().version}")
        return DONE
    if options.config_dir:
        from evoros.config.compose import add_config_dir

        add_config_dir(options.config_dir)
    if any(override.startswith("resume=") for override in options.overrides):
        if options.shows or options.multirun:
            raise InputError("resume=: goes with --config-dir only; leave the other options out")
        return _resume(command, options, interrupts)
    if options.shows:
        from evoros.config.help import show

        return show(command.name, command.primary, arguments)
    return _start(command, options, interrupts)


def _resume(command: Command, options: "Options", interrupts: Interrupts) -> int:
    """Go on with the work in the folder of ``resume=FOLDER``."""
    target = next(text for text in options.overrides if text.startswith("resume="))
    folder = expand_home(target.partition("=")[2])
    overrides = [text for text in options.overrides if text is not target]
    build = partial(command.load().open, folder, overrides, options.config_dir)
    return _run_alone(command, build, folder, options.config_dir, interrupts)


def _start(command: Command, options: "Options", interrupts: Interrupts) -> int:
    """Start one job, or the jobs of a sweep."""
    from evoros.config.jobs import Job, Jobs

    jobs = Jobs(options.overrides, options.multirun, options.config_dir, command.primary)
    if jobs.sweep is not None:
        from evoros.cli.sweeping import run_by_plugins, run_sweep

        run = run_by_plugins if jobs.plugins else run_sweep
        return run(command, jobs, options.config_dir, interrupts)
    (job,) = (job for job in jobs if isinstance(job, Job))
    build = partial(command.create, job.config, job.folder)
    return _run_alone(command, build, job.folder, options.config_dir, interrupts)


def _run_alone(
    command: Command,
    build: "Callable[[], Work]",
    folder: Path,
    config_dir: str | None,
    interrupts: Interrupts,
) -> int:
    """Build and run the only job, report its result and return the exit status."""
    from evoros.session.progress import Progress

    result = JobResult(DONE)
    try:
        with Progress() as display:
            build().run(display, draw_figure)
    except (KeyboardInterrupt, Exception) as error:
        result = explain_end(config_dir, interrupts, folder, error)
    return report_result(command, False, folder, result)
