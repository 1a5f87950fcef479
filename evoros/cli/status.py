"""The subcommand ``status``, and tables of a sweep's jobs or of all runs below a folder."""

import sys
import time
from collections.abc import Sequence
from itertools import takewhile
from pathlib import Path
from shutil import get_terminal_size

from evoros.base.errors import InputError
from evoros.cli.reporting import JobResult
from evoros.session.status import COLUMNS, UNKNOWN, Overview, list_cells, survey
from evoros.storage.archives import open_folder
from evoros.storage.layout import RUNNING, folders_below, natural_key
from evoros.terminal.console import DONE, INPUT, CommandParser, print_result, reports_errors
from evoros.terminal.log import warn_left_out

NAME = "evoros status"
ABOUT = """Show the state of all runs and evaluations below a folder; on a terminal, update
the table until all have ended."""
UPDATE_S = 2.0  # interval between updates


@reports_errors(NAME)
def status(arguments: Sequence[str]) -> int:
    """Print the table once, or update it on a terminal while a run is active."""
    from rich.live import Live
    from rich.text import Text

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
    overviews = [survey(path) for path in folders_below(folder, warn_left_out)]
    if not overviews:
        raise InputError(f"{folder}: contains no run, evaluation or sweep; correct the path")
    running = any(overview.state == RUNNING for overview in overviews)
    return format_folders(folder, overviews), running


KEPT, REFUSED = "kept", "refused"  # states: complete before the sweep; rejected for a fault
SCORES = COLUMNS.index("missions") + 1  # number of ``COLUMNS`` shown for jobs
CUT, GAP, SHORTEST = "...", 2, 16  # ellipsis, spaces between columns, minimum width of names


def format_jobs(results: Sequence[tuple[Path, JobResult]]) -> str:
    """Format the results of a sweep's jobs as a table, sorted by folder name."""
    rows = [("job", *COLUMNS[:SCORES])]
    for folder, result in sorted(results, key=lambda pair: natural_key(pair[0].name)):
        if result.status == INPUT:  # the folder exists and belongs to another job
            rows.append((folder.name, REFUSED, *[UNKNOWN] * (SCORES - 1)))
            continue
        state, *cells = list_cells(survey(folder))[:SCORES]
        rows.append((folder.name, KEPT if result.kept else state, *cells))
    return _align(rows)


def format_folders(base: Path, overviews: Sequence[Overview]) -> str:
    """Format the folders below ``base`` as a table, followed by the reasons of failures."""
    rows: list[tuple[str, ...]] = [("folder", *COLUMNS)]
    reasons = []
    for overview in overviews:
        name = str(overview.path.relative_to(base))
        rows.append((name, *list_cells(overview)))
        if overview.reason:
            reasons.append(f"{name}: {overview.reason}")
    return "\n".join([_align(rows), *reasons])


def _align(rows: Sequence[Sequence[str]]) -> str:
    """Left-align text and right-align numbers; shorten names so that lines fit the terminal."""
    if sys.stdout.isatty():
        others = [max(map(len, column)) + GAP for column in zip(*rows, strict=True)][1:]
        room = get_terminal_size().columns - sum(others)
        names = shorten_names([row[0] for row in rows[1:]], room)
        rows = [rows[0], *([name, *row[1:]] for name, row in zip(names, rows[1:], strict=True))]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        words = [cell.ljust(width) for cell, width in zip(row[:2], widths[:2], strict=True)]
        numbers = [cell.rjust(width) for cell, width in zip(row[2:], widths[2:], strict=True)]
        lines.append((GAP * " ").join([*words, *numbers]).rstrip())
    return "\n".join(lines)


def shorten_names(names: Sequence[str], room: int) -> list[str]:
    """Shorten names to ``room`` characters: cut the common prefix, then the middle."""
    room = max(room, SHORTEST)
    if max(map(len, names), default=0) <= room:
        return list(names)
    columns = zip(*names, strict=False)
    same = takewhile(lambda column: len(set(column)) == 1, columns)
    common = sum(1 for _ in same) if len(names) > 1 else 0
    if common > len(CUT):
        names = [CUT + name[common:] for name in names]
    kept = room - len(CUT)
    end = kept // 3  # a name ends with a hash that distinguishes it
    return [name if len(name) <= room else name[: kept - end] + CUT + name[-end:] for name in names]
