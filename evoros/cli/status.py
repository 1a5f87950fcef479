"""The subcommand ``status``: shows the progress of all runs and evaluations below a folder."""

import sys
import time
from collections.abc import Sequence
from pathlib import Path

from evoros.base.errors import InputError
from evoros.terminal.console import DONE, CommandParser, print_result, reports_errors
from evoros.terminal.log import warn_left_out

NAME = "evoros status"
ABOUT = """Show the state of all runs and evaluations below a folder; on a terminal, update it until
all have ended."""
UPDATE_S = 2.0  # interval between updates


@reports_errors(NAME)
def status(arguments: Sequence[str]) -> int:
    """Print the table once, or update it on the terminal while a run is active."""
    from rich.live import Live
    from rich.text import Text

    from evoros.storage.archives import open_folder

    parser = CommandParser(NAME, description=ABOUT)
    parser.add_argument("folder", nargs="?", default="outputs", help="default: outputs")
    parser.add_argument("--once", action="store_true", help="print the table and exit")
    options = parser.parse(arguments)
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
    from evoros.cli.job_table import format_folders
    from evoros.session.status import survey
    from evoros.storage.layout import RUNNING, folders_below

    overviews = [survey(path) for path in folders_below(folder, warn_left_out)]
    if not overviews:
        raise InputError(f"{folder}: contains no run, evaluation or sweep; correct the path")
    running = any(overview.state == RUNNING for overview in overviews)
    return format_folders(folder, overviews), running
