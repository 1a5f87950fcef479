"""The table of coverage has every interval and test, and its numbers are found again."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from covering import SUBJECTS, find_drifts, measure
from documents import table, text
from rows import SLOW, Subject
from scipy.stats import binom
from stated import find_shortfall, get_stated

from evoros.analysis.statistics.small_samples import INTERVALS, TESTS, Shortfall

ROOT = Path(__file__).parents[2]
TABLE = (ROOT / "benchmarks/coverage/table.md").read_text()
UNCERTAIN = re.compile(r"\b(Interval|Bounds|EffectTest)\b")
SHOWN = re.compile(
    r"\bp of\b|\bthe p\b|-sided p\b|\bp-values?\b|\bchances? (of|that)\b|[Cc]onfidence"
)
ELSEWHERE = {
    "advise_seeds": "warns of the minimum of a p",
    "bound_combined": "passes on the interval of a fitness",
    "deviation": "is a property of Scatter",
    "format_p": "writes a p",
    "list_rivals": "passes on intervals of means",
    "minimum_p": "is the minimum of a p",
    "warn_of_few_seeds": "warns of the minimum of a p",
}
"""Functions that the simulations reach by the name of another one."""


def list_uncertain() -> Iterator[str]:
    """Yield the names of public functions that return intervals, p, or what holds in part."""
    for package in ("evoros", "analysis"):
        for path in (ROOT / package).rglob("*.py"):
            text = path.read_text()
            if not (UNCERTAIN.search(text) or SHOWN.search(text)):
                continue
            for node in ast.walk(ast.parse(text)):
                if not isinstance(node, ast.FunctionDef) or node.name.startswith("_"):
                    continue
                returned = ast.unparse(node.returns) if node.returns else ""
                if UNCERTAIN.search(returned) or SHOWN.search(ast.get_docstring(node) or ""):
                    yield node.name


def test_every_interval_and_test_is_in_the_table() -> None:
    names = {function.__name__ for subject in SUBJECTS for function in subject.functions}
    listed = set(list_uncertain())
    assert not listed - names - set(ELSEWHERE)
    assert set(ELSEWHERE) <= listed


@pytest.mark.parametrize("subject", SUBJECTS, ids=lambda subject: subject.name)
def test_the_table_has_every_row(subject: Subject) -> None:
    documented = read_page(subject)
    assert list(documented) == [row.data for row in subject.rows]
    for row, cells in zip(subject.rows, documented.values(), strict=True):
        assert set(cells) == set(row.trials) or len(cells) < len(row.trials)


@pytest.mark.parametrize("subject", SUBJECTS, ids=lambda subject: subject.name)
def test_what_is_short_is_printed_with_its_number(subject: Subject) -> None:
    """The number is the worst one of the table, and every command that uses the method names it."""
    cells = [(name, 100 * x) for row in read_page(subject).values() for name, x in row.items()]
    assert find_shortfall(subject, cells) == get_stated(subject)
    if get_stated(subject) != Shortfall(None):
        for command in subject.printed_by.split(", "):
            where = "report/summary" if command == "report" else f"figures/{command}"
            assert f'"{subject.name}"' in (ROOT / f"analysis/{where}.py").read_text()


def test_the_page_has_what_is_short() -> None:
    printed_by = {subject.name: subject.printed_by for subject in SUBJECTS}
    rows = table(text("coverage"), "interval or test")
    numbers = {row[0]: tuple(int(x) if x else None for x in row[3:]) for row in rows}
    assert numbers == {**INTERVALS, **TESTS}
    assert all(row[1] == printed_by[row[0]] for row in rows)


def test_the_command_reports_what_it_measures_otherwise() -> None:
    """A method that is as good as is stated, or luckier by less than luck, drifts by nothing."""
    subject = next(one for one in SUBJECTS if get_stated(one).usual)
    index, (usual, outlier) = SUBJECTS.index(subject), get_stated(subject)
    assert usual is not None
    assert outlier is not None
    columns = dict.fromkeys(subject.columns, usual) | {"1 in 100": outlier}

    def drift(change: int) -> list[str]:
        counts = {name: (10 * (share + change), 1000) for name, share in columns.items()}
        return list(find_drifts([(index, 0, counts)]))

    assert not drift(0) + drift(2) + drift(-2)
    assert all(subject.name in line for line in drift(-10))
    assert len(drift(-10)) == 2


@pytest.mark.parametrize(
    "subject", [one for one in SUBJECTS if one.repetitions > SLOW], ids=lambda subject: subject.name
)
def test_a_sample_agrees_with_the_table(subject: Subject) -> None:
    """A row whose shares are as documented, within 3 %, fails once in ten thousand."""
    row, count = subject.rows[0], 40
    documented = read_page(subject)[row.data]
    for column, (positive, known) in measure(subject, row, count, 1).items():
        share = documented[column]
        low = binom.ppf(1e-4, known, max(0.0, share - 0.03))
        high = binom.isf(1e-4, known, min(1.0, share + 0.03))
        assert low <= positive <= high, column


def read_page(subject: Subject) -> dict[str, dict[str, float]]:
    """Return the documented shares of a subject's rows by column."""
    rows: dict[str, dict[str, float]] = {}
    columns: list[str] = []
    inside = False
    for line in TABLE.splitlines():
        cells = [cell.strip().strip("*") for cell in line.strip("|").split("|")]
        if not line.startswith("|") or len(cells) < 5:
            inside = False
            continue
        if cells[0] == "what":
            columns = cells[4:]
        inside = cells[0] == subject.name or (inside and not cells[0])
        if inside:
            known = {name: cell for name, cell in zip(columns, cells[4:], strict=True) if cell}
            rows[cells[3]] = {name: float(cell) / 100 for name, cell in known.items()}
    return rows
