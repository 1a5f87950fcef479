"""The subcommand ``resume``: continues the run in a folder."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from evoros.base.errors import InputError
from evoros.cli.command import run_alone
from evoros.cli.reporting import Interrupts
from evoros.files.resources import expand_home
from evoros.terminal.arguments import CommandParser, require_keys
from evoros.terminal.console import report_errors

if TYPE_CHECKING:
    from evoros.session.run import Session

NAME = "evoros resume"
ABOUT = """Continue a stopped run, with the same result as an uninterrupted one.
Extend a search with optimizer.generations=MORE, an evaluation with trials=MORE."""


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
        help="executor.KEY, observers, optimizer.generations, trials",
    )
    parser.add_argument("--config-dir", "-cd", metavar="FOLDER", help="folder of your own parts")
    options = parser.parse_intermixed_args(list(arguments))
    require_keys(options.overrides, options.folder)
    folder = expand_home(options.folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: must be the folder of a run; correct the path")

    def build() -> "Session":
        from evoros.session.run import open_run

        return open_run(folder, options.overrides, options.config_dir)

    name = EVALUATE if evaluates(folder) else RUN
    return run_alone(name, build, folder, options.config_dir, interrupts)
