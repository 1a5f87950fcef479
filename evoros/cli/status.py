"""The subcommand ``status``: shows all runs and evaluations below a folder, as they go on."""

import sys
import time
from collections.abc import Sequence
from pathlib import Path

from evoros.base.errors import InputError
from evoros.terminal.arguments import CommandParser
from evoros.terminal.console import DONE, print_result, reports_errors
from evoros.terminal.log import warn_left_out

NAME = "evoros status"
UPDATE_S = 2.0
"""Wall clock between two looks at the folders."""


@reports_errors(NAME)
def status(arguments: Sequence[str]) -> int:
    """Print the table once, or keep it on the terminal while anything runs."""
    from rich.live import Live
    from rich.text import Text

    from evoros.storage.archives import open_folder

    options = _parser().parse(arguments)
    folder = open_folder(options.folder)
    table, running = _look(folder)
    if running and not options.once and sys.stdout.isatty():
        with Live(Text(table), auto_refresh=False, transient=True) as live:
            while running:
                time.sleep(UPDATE_S)
                table, running = _look(folder)
                live.update(Text(table), refresh=True)
    print_result(table)
    return DONE


def _look(folder: Path) -> tuple[str, bool]:
    """Return the table of the folders below, and whether any of them runs."""
    from evoros.cli.job_table import format_folders
    from evoros.session.overview import survey
    from evoros.storage.discovery import folders_below
    from evoros.storage.layout import RUNNING

    overviews = [survey(path) for path in folders_below(folder, warn_left_out)]
    if not overviews:
        raise InputError(
            f"{folder}: must be the folder of a run, an evaluation or a sweep, or one above such, "
            f"and has none; correct the path"
        )
    return format_folders(folder, overviews), any(
        overview.state == RUNNING for overview in overviews
    )


def _parser() -> CommandParser:
    parser = CommandParser(
        NAME,
        description="Shows the state of all runs and evaluations below a folder, and follows them "
        "on a terminal until none runs any more.",
    )
    parser.add_argument("folder", nargs="?", default="outputs", help="default: outputs")
    parser.add_argument("--once", action="store_true", help="print the table and exit")
    return parser
