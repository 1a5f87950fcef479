"""The subcommand ``leaderboard``, which makes rows from runs and verifies rows by rerunning."""

import shlex
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from evoros.base.errors import InputError
from evoros.files.resources import expand_home
from evoros.terminal import console

if TYPE_CHECKING:
    from evoros.plugins.leaderboard.rows import Row

NAME = "evoros leaderboard"
ABOUT = """Print a row of the leaderboard for each finished run of a task.

Each row holds the overrides that repeat the run, and a digest of the results. --check reruns the
rows in a file and compares all cells except the version of evoros. Rows in --known are skipped.
The check runs the code in a row's config_dir; see docs/run_folder.md before you check other
people's rows."""
STATUSES = """exit status: 0 done, 1 a row could not be reproduced, 2 invalid folder or file."""


@console.reports_errors(NAME)
def leaderboard(arguments: Sequence[str]) -> int:
    """Run the command and return its exit status."""
    from evoros.plugins.leaderboard.rows import make_row, write_rows

    parser = console.CommandParser(NAME, description=ABOUT, epilog=STATUSES)
    about = "folder of a finished run of a task"
    parser.add_argument("folders", nargs="*", metavar="FOLDER", help=about)
    parser.add_argument("--check", metavar="CSV", help="rerun the rows in this file instead")
    parser.add_argument("--known", metavar="CSV", help="with --check: a file with rows to skip")
    parser.add_argument("--config-dir", "-cd", metavar="DIR", help="folder with your own search")
    options = parser.parse_args(list(arguments))
    if bool(options.folders) == bool(options.check):
        raise InputError(f"FOLDER: either folders or --check CSV must be given; see {NAME} --help")
    if options.check:
        return _check(expand_home(options.check), options.known and expand_home(options.known))
    rows = [make_row(expand_home(folder), options.config_dir) for folder in options.folders]
    console.print_result(write_rows(rows).rstrip("\n"))
    return console.DONE


def _check(file: Path, known: Path | None) -> int:
    from evoros.plugins.leaderboard.rows import read_rows

    left_out = set(read_rows(known)) if known else set()
    status = console.DONE
    for line, row in enumerate(read_rows(file), 2):
        if row in left_out:
            continue
        if problem := _find_difference(row):
            message = f"{file}: line {line} ({row.name}): {problem}"
            status = console.report_error(NAME, message, console.DIFFERENT)
        else:
            console.print_result(f"line {line} ({row.name}): reproduced")
    return status


def _find_difference(row: "Row") -> str:
    """Rerun a row; describe the first cell that differs, or return ""."""
    from evoros.analysis.run_figures import draw_figure
    from evoros.config.compose import compose
    from evoros.plugins.leaderboard.rows import COLUMNS, make_row
    from evoros.session.run import create_run
    from evoros.session.status import NoDisplay

    config_dir = row.config_dir or None
    typed = [*shlex.split(row.overrides), "figures=[]", "record=none"]
    with TemporaryDirectory() as scratch:
        folder = Path(scratch) / "run"
        create_run(compose(typed, config_dir=config_dir), folder).run(NoDisplay(), draw_figure)
        again = make_row(folder, config_dir)
    for name in COLUMNS:
        stated, found = getattr(row, name), getattr(again, name)
        if name != "version" and stated != found:
            return f"{name} is {stated}, but {found} when the row is rerun"
    return ""
