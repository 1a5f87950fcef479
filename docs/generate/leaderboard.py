"""The page of the leaderboard, from its rows."""

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from statistics import fmean, median

from evoros.plugins.leaderboard.rows import PREFIX, TASKS, Row, read_rows

from .markdown import code, page, table

FILE = Path(__file__).parents[2] / "benchmarks" / "leaderboard.csv"
HEADS = ("search", "seeds", "median fitness", "lowest to highest", "completed", "missions")
ABOUT = """Compare searches by the scores of their champions on the tasks of the
[benchmark](benchmark.md#add-a-row), on 30 trials that no search has met. The digest and the
interval of a row in `benchmarks/leaderboard.csv` hold for its `version`. `python docs/reference.py`
makes this page from that file."""


def write_page() -> str:
    """Return the text of the page."""
    rows = read_rows(FILE)
    return page(["# Leaderboard", ABOUT, *(_write_task(name, rows) for name in TASKS)])


def _write_task(name: str, rows: Sequence[Row]) -> str:
    task = name.removeprefix(PREFIX)
    ours = sorted((row for row in rows if row.task == task), key=lambda row: row.search)
    if not ours:
        return f"## {task}\n\nNo rows yet: {code(f'experiment={name}')}."
    groups = [list(group) for _, group in groupby(ours, lambda row: row.search)]
    groups.sort(key=lambda group: -median(float(row.fitness) for row in group))
    return f"## {task}\n\n{code(f'experiment={name}')}\n\n" + table(HEADS, map(_write_row, groups))


def _write_row(group: Sequence[Row]) -> tuple[str, ...]:
    scores = [float(row.fitness) for row in group]
    return (
        code(f"optimizer={group[0].search}"),
        str(len(group)),
        f"{median(scores):.2f}",
        f"{min(scores):.2f} to {max(scores):.2f}",
        f"{100 * fmean(float(row.completed) for row in group):.0f} %",
        f"{fmean(float(row.missions) for row in group):.0f}",
    )
