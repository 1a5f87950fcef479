"""Tables of runs and evaluations: the jobs of a sweep, or all folders below one."""

from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path

from evoros.cli.reporting import JobResult
from evoros.session.overview import Overview, survey
from evoros.storage.discovery import natural_key
from evoros.terminal.console import INPUT

KEPT, REFUSED = "kept", "refused"
"""States of jobs alone: complete before the sweep was repeated; not begun for an error."""
UNKNOWN = "-"


def format_jobs(results: Sequence[tuple[Path, JobResult]]) -> str:
    """Format the jobs of a sweep, with their folders and results, in the order of their names."""
    header = ("job", "state", "done", "best", "validated", "missions")
    rows = []
    for folder, result in sorted(results, key=lambda pair: natural_key(pair[0].name)):
        if result.status == INPUT:  # its folder, if there is one, is another job's
            rows.append((folder.name, REFUSED, *[UNKNOWN] * 4))
            continue
        overview = survey(folder)
        state = KEPT if result.kept else overview.state
        rows.append((folder.name, state, *_describe_scores(overview)))
    return _align([header, *rows])


def format_folders(base: Path, overviews: Sequence[Overview]) -> str:
    """Format the folders below a base folder, and below the table why some have failed."""
    header = ("folder", "state", "done", "best", "validated", "missions", "sim s/s", "left")
    rows, reasons = [header], []
    for overview in overviews:
        name, left_s = str(overview.path.relative_to(base)), overview.left_s
        clock = UNKNOWN if left_s is None else str(timedelta(seconds=round(left_s)))
        scores = _describe_scores(overview)
        rows.append((name, overview.state, *scores, _format(overview.speed, 0), clock))
        if overview.reason:
            reasons.append(f"{name}: {overview.reason}")
    return "\n".join([_align(rows), *reasons])


def _align(rows: Sequence[Sequence[str]]) -> str:
    """Align the cells of rows in columns, words to the left and numbers to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        words = [cell.ljust(width) for cell, width in zip(row[:2], widths[:2], strict=True)]
        numbers = [cell.rjust(width) for cell, width in zip(row[2:], widths[2:], strict=True)]
        lines.append("  ".join([*words, *numbers]).rstrip())
    return "\n".join(lines)


def _describe_scores(overview: Overview) -> tuple[str, str, str, str]:
    return (
        f"{overview.done}/{overview.wanted}" if overview.wanted else UNKNOWN,
        _format(overview.best, 3),
        _format(overview.validated, 3),
        str(overview.missions),
    )


def _format(value: float | None, digits: int) -> str:
    return UNKNOWN if value is None else f"{value:.{digits}f}"
