"""The parts that evolving and evaluating share: arguments, messages, exit statuses.

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
from evoros.cli.subcommands import SUBCOMMANDS
from evoros.files.origin import read_origin
from evoros.terminal.arguments import require_keys
from evoros.terminal.console import DONE, print_result, report_errors

if TYPE_CHECKING:
    from evoros.config.like import RecordedRun
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
    for word in set(options.overrides) & set(SUBCOMMANDS):
        raise InputError(f"{word}: must be the first word; type: evoros {word} ...")
    require_keys(options.overrides, f"{command.folder_key}=")
    if options.shows:
        from evoros.config.help import show
        from evoros.config.like import choose_primary

        typed = options.overrides
        primary, _ = choose_primary(command.primary, typed, options.config_dir, _read_run)
        others = [word for word in arguments if word not in typed]
        return show(command.name, primary, [*typed, *others])  # Hydra takes them in this order only
    return _start(command, options, interrupts)


def _start(command: Command, options: "Options", interrupts: Interrupts) -> int:
    """Start one job, or the jobs of a sweep."""
    from evoros.config.jobs import Job, Jobs

    overrides = options.overrides
    jobs = Jobs(overrides, options.multirun, options.config_dir, command.primary, _read_run)
    if jobs.sweep is not None:
        from evoros.cli.sweeping import run_by_plugins, run_sweep

        run = run_by_plugins if jobs.plugins else run_sweep
        return run(command, jobs, options.config_dir, interrupts)
    (job,) = (job for job in jobs if isinstance(job, Job))
    build = partial(command.create, job.config, job.folder)
    return run_alone(command, build, job.folder, options.config_dir, interrupts)


def _read_run(source: str, typed: frozenset[str]) -> "RecordedRun":
    """Read the run whose configuration an evaluation takes over."""
    from evoros.session.like import read_like

    return read_like(source, typed)


def run_alone(
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
