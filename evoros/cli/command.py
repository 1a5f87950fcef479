"""The commands that start or resume a search or an evaluation.

Exit statuses: 0 done; 1 stopped, resumable; 2 invalid input; 130 interrupted.
"""

from argparse import Action, ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evoros.base.errors import InputError
from evoros.cli.reporting import Interrupts, JobResult, explain_end, report_result
from evoros.cli.subcommands import SUBCOMMANDS
from evoros.files.origin import read_origin
from evoros.files.resources import expand_home, find_config_dir
from evoros.terminal.console import DONE, CommandParser, print_result, report_errors, require_keys

if TYPE_CHECKING:
    from evoros.config.like import RecordedRun
    from evoros.session.run import Session


def parse_options(arguments: Sequence[str]) -> Namespace:
    """Parse the arguments of a command; options and overrides can be mixed."""
    return _parser().parse_intermixed_args(list(arguments))


class _Refuse(Action):
    def __call__(self, parser: ArgumentParser, *_: Any) -> None:
        raise InputError(
            f"{self.option_strings[0]}: not an option of evoros; use experiment= for a study"
        )


def _parser() -> ArgumentParser:
    """Return a parser for Hydra's options; ``config/help.py`` passes some of them on to Hydra."""
    parser = CommandParser("evoros", add_help=False)
    parser.add_argument("overrides", nargs="*")
    parser.add_argument("--multirun", "-m", action="store_true")
    parser.add_argument("--config-dir", "-cd")
    parser.add_argument("--version", action="store_true")
    parser.add_argument("--help", "-h", action="store_true")
    parser.add_argument("--hydra-help", action="store_true")
    parser.add_argument("--cfg", "-c", choices=["job", "hydra", "all"])
    parser.add_argument("--resolve", action="store_true")  # needs --cfg
    parser.add_argument("--package", "-p")  # needs --cfg
    parser.add_argument("--shell-completion", "-sc", action="store_true")
    info = ["all", "config", "defaults", "defaults-tree", "plugins", "searchpath"]
    parser.add_argument("--info", "-i", nargs="?", const="all", choices=info)
    for name, short in (("--config-name", "-cn"), ("--config-path", "-cp")):
        parser.add_argument(name, short, action=_Refuse)
    parser.add_argument("--experimental-rerun", action=_Refuse)
    return parser


@dataclass(frozen=True)
class Command:
    """A console command."""

    name: str
    primary: str  # primary configuration file in conf/
    folder_key: str  # key to suggest for a folder typed without a key

    def __call__(self, arguments: Sequence[str]) -> int:
        """Run the command and return its exit status."""
        with Interrupts() as interrupts:
            run = partial(_execute, self, list(arguments), interrupts)
            return report_errors(self.name, run, interrupts.explain)


def _execute(command: Command, arguments: list[str], interrupts: Interrupts) -> int:
    options = parse_options(arguments)
    if options.version:
        print_result(f"{command.name} {read_origin().version}")
        return DONE
    if options.help:
        from evoros.cli.help import format_help

        folder = find_config_dir(options.config_dir) if options.config_dir else None
        print_result(format_help(command.primary, folder))
        return DONE
    if options.config_dir:
        from evoros.config.compose import add_config_dir

        add_config_dir(options.config_dir)
    for word in set(options.overrides) & set(SUBCOMMANDS):
        raise InputError(f"{word}: a subcommand must come first; type: evoros {word} ...")
    require_keys(options.overrides, f"{command.folder_key}=")
    if any(
        (options.hydra_help, options.cfg, options.info, options.shell_completion)
    ):  # Hydra only prints
        from evoros.config.help import show
        from evoros.config.like import choose_primary

        typed = options.overrides
        primary, _ = choose_primary(command.primary, typed, options.config_dir, _read_run)
        others = [word for word in arguments if word not in typed]
        words = [*typed, *others]  # the only order accepted by Hydra
        return show(command.name, primary, words)
    return _start(command, options, interrupts)


def _start(command: Command, options: Namespace, interrupts: Interrupts) -> int:
    from evoros.config.jobs import Job, Jobs

    overrides = options.overrides
    jobs = Jobs(overrides, options.multirun, options.config_dir, command.primary, _read_run)
    if jobs.sweep is not None:
        from evoros.cli.sweep import run_by_plugins, run_sweep

        run = run_by_plugins if jobs.plugins else run_sweep
        return run(command.name, jobs, options.config_dir, interrupts)
    (job,) = (job for job in jobs if isinstance(job, Job))

    def build() -> "Session":
        from evoros.analysis.run_figures import check_figures
        from evoros.session.run import create_run

        check_figures(job.config.values)
        return create_run(job.config, job.folder)

    return run_alone(command.name, build, job.folder, options.config_dir, interrupts)


def _read_run(source: str, typed: frozenset[str]) -> "RecordedRun":
    from evoros.session.given_designs import read_like

    return read_like(source, typed)


def run_alone(
    name: str,
    build: "Callable[[], Session]",
    folder: Path,
    config_dir: str | None,
    interrupts: Interrupts,
    typed: Sequence[str] = (),
) -> int:
    """Build and run a single job, report the result, and return the exit status."""
    from evoros.analysis.run_figures import draw_figure
    from evoros.session.controls import run as run_with_controls
    from evoros.session.progress import Progress

    result = JobResult(DONE)
    try:
        with Progress() as display:
            run_with_controls(build(), display, draw_figure)
    except (KeyboardInterrupt, Exception) as error:
        result = explain_end(config_dir, interrupts, folder, error, typed)
    return report_result(name, False, folder, result)


run = Command("evoros", "config", "hydra.run.dir")
evaluate = Command("evoros evaluate", "evaluate", "like")


NAME = "evoros resume"
ABOUT = """Continue a stopped run; the result is the same as without the interruption.
Extend a search with optimizer.generations=MORE or a larger limit, such as stop_after.missions=MORE;
an evaluation with trials=MORE."""


def resume(arguments: Sequence[str]) -> int:
    """Run the subcommand and return its exit status."""
    with Interrupts() as interrupts:
        return report_errors(NAME, lambda: _resume(arguments, interrupts), interrupts.explain)


def _resume(arguments: Sequence[str], interrupts: Interrupts) -> int:
    from evoros.storage.layout import EVALUATE, RUN, evaluates

    parser = CommandParser(NAME, description=ABOUT)
    parser.add_argument("folder", metavar="FOLDER")
    parser.add_argument(
        "overrides",
        nargs="*",
        metavar="key=value",
        help="executor.KEY, observers, optimizer.generations, trials, stop_after.KEY",
    )
    parser.add_argument("--config-dir", "-cd", metavar="FOLDER", help="folder with your own parts")
    options = parser.parse_intermixed_args(list(arguments))
    require_keys(options.overrides, options.folder)
    folder = expand_home(options.folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: folder not found; correct the path")

    def build() -> "Session":
        from evoros.session.run import open_run

        return open_run(folder, options.overrides, options.config_dir)

    name = EVALUATE if evaluates(folder) else RUN
    return run_alone(name, build, folder, options.config_dir, interrupts, options.overrides)
