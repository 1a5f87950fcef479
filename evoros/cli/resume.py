"""The subcommand ``resume``: continues the run or the evaluation in a folder."""

from collections.abc import Sequence
from functools import partial

from evoros.base.errors import InputError
from evoros.cli.command import run_alone
from evoros.cli.evaluate import evaluate
from evoros.cli.interrupts import Interrupts
from evoros.cli.run import run
from evoros.files.resources import expand_home
from evoros.terminal.arguments import CommandParser, require_keys
from evoros.terminal.console import report_errors

NAME = "evoros resume"
ABOUT = """Continues a stopped run or evaluation from its record, with the same result as without
the stop. A finished run goes on with optimizer.generations=MORE."""


def resume(arguments: Sequence[str]) -> int:
    """Run the subcommand and return its exit status."""
    with Interrupts() as interrupts:
        return report_errors(NAME, lambda: _resume(arguments, interrupts), interrupts.explain)


def _resume(arguments: Sequence[str], interrupts: Interrupts) -> int:
    from evoros.storage.layout import command_of

    parser = CommandParser(NAME, description=ABOUT)
    parser.add_argument("folder", metavar="FOLDER")
    parser.add_argument(
        "overrides",
        nargs="*",
        metavar="key=value",
        help="executor.KEY, observers, optimizer.generations",
    )
    parser.add_argument("--config-dir", "-cd", metavar="FOLDER", help="folder of your own parts")
    options = parser.parse_intermixed_args(list(arguments))
    require_keys(options.overrides, options.folder)
    folder = expand_home(options.folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: must be the folder of a run or an evaluation; correct it")
    command = evaluate if command_of(folder) == evaluate.name else run
    build = partial(command.load().open, folder, options.overrides, options.config_dir)
    return run_alone(command, build, folder, options.config_dir, interrupts)
