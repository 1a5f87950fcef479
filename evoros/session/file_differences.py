"""The first difference between two files of runs: line and column, key, or byte."""

import csv
from collections.abc import Iterator
from contextlib import suppress
from itertools import zip_longest
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.files.nested import parse_json
from evoros.storage.file_reading import read_bytes
from evoros.storage.layout import MISSIONS

KEYS = (("generation", "design", "world", "trial"), ("source", "design", "world", "trial"))
"""Columns that identify a mission of a run, and of an evaluation."""
FIGURES = "figures/"
"""The folder of figures, which can be drawn at any time, so that one run may have more of them."""
SHOWN = 60  # characters of a value
NOTHING = "nothing"
Key = tuple[tuple[str, str], ...]  # name and cell of each column that identifies a mission


def compare_missions(one: Path, other: Path) -> tuple[str, int]:
    """Return the first difference of two tables of missions, and the number of missions.

    The order of the rows does not matter, because unfinished runs have them as they were completed.
    """
    first, second = (_read_missions(folder / MISSIONS) for folder in (one, other))
    for key in sorted({*first, *second}, key=_order):
        (line, row), (other_line, other_row) = first.get(key, (0, {})), second.get(key, (0, {}))
        if row == other_row:
            continue
        mission = ", ".join(f"{name} {value}" for name, value in key)
        if not row or not other_row:
            return f"{MISSIONS}: the mission {mission} is only in {one if row else other}", 0
        column = next(c for c in [*row, *other_row] if row.get(c) != other_row.get(c))
        where = f"line {line}" + (f" and {other_line}" if line != other_line else "")
        told = tell(column, one, row.get(column), other, other_row.get(column))
        return f"{MISSIONS}: {where} (the mission {mission}): {told}", 0
    return "", len(first)


def _order(key: Key) -> list[tuple[int, str]]:
    return [(int(value) if value.isdecimal() else -1, value) for _, value in key]


def _read_missions(path: Path) -> dict[Key, tuple[int, dict[str, str]]]:
    """Read the line and the cells of each complete row, by its key."""
    try:
        complete = read_bytes(path).decode().rpartition("\n")[0]
        rows = csv.DictReader(complete.splitlines())
        names = next((keys for keys in KEYS if {*keys} <= {*(rows.fieldnames or ())}), None)
        if names is None:
            raise ValueError(f"line 1 must have the columns {', '.join(KEYS[0])}")
        return {tuple((n, row[n]) for n in names): (rows.line_num, row) for row in rows}
    except (ValueError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read ({error}); restore the file") from error


def find_difference(one: Path, other: Path, name: str) -> str:
    """Return the first difference between two files of this name; empty if they are equal."""
    first, second = read_bytes(one / name), read_bytes(other / name)
    if first == second:
        return ""
    try:
        texts = first.decode(), second.decode()
    except UnicodeDecodeError:
        return f"{name}: {_find_byte(first, second)} differs between {one} and {other}"
    if name.startswith(FIGURES) and name.endswith(".csv"):
        pairs = zip((one, other), texts, strict=True)
        with suppress(csv.Error):
            if len({tuple(_read_unnamed(text, folder)) for folder, text in pairs}) == 1:
                return ""
    find = {".csv": _find_cell, ".json": _find_key}.get(Path(name).suffix, _find_line)
    place, value, other_value = find(*texts)
    return f"{name}: {tell(place, one, value, other, other_value)}"


def _read_unnamed(text: str, folder: Path) -> Iterator[tuple[str, ...]]:
    """Yield the rows of a figure's table without the name of the folder that it was drawn in."""
    rows, run = csv.reader(text.splitlines()), folder.resolve().name
    header = next(rows, [])
    yield tuple(header)
    for row in rows:
        pairs = zip_longest(header, row, fillvalue="")
        yield tuple("" if (name, cell) == ("run", run) else cell for name, cell in pairs)


def tell(place: str, one: Path, first: object, other: Path, second: object) -> str:
    """Tell which value each of two folders has."""
    return f"{place} is {_shorten(first)} in {one} and {_shorten(second)} in {other}"


Difference = tuple[str, object, object]  # its place, and both values


def _find_byte(first: bytes, second: bytes) -> str:
    pairs = enumerate(zip_longest(first, second))
    return f"byte {next(index for index, (a, b) in pairs if a != b)}"


def _find_line(first: str, second: str) -> Difference:
    pairs = enumerate(zip_longest(first.split("\n"), second.split("\n")), 1)
    index, pair = next((index, pair) for index, pair in pairs if pair[0] != pair[1])
    line, other = (NOTHING if text is None else text for text in pair)
    return f"line {index}", line, other


def _find_cell(first: str, second: str) -> Difference:
    """Find the first cell that differs, named by its column."""
    line, content, other = _find_line(first, second)
    with suppress(csv.Error):  # such as a cell of 200,000 characters
        return _find_column(first, second, line, content, other)
    return line, content, other


def _find_column(first: str, second: str, line: str, content: object, other: object) -> Difference:
    headers = [next(csv.reader(text.splitlines()), []) for text in (first, second)]
    if headers[0] == headers[1] and NOTHING not in (content, other):
        cells = [next(csv.reader([str(text)]), []) for text in (content, other)]
        for column, one_cell, other_cell in zip(headers[0], *cells, strict=False):
            if one_cell != other_cell:
                return f"{line}: {column}", one_cell, other_cell
    return line, content, other


def _find_key(first: str, second: str) -> Difference:
    """Find the first value that differs, named by its path."""
    try:
        values, others = (dict(_flatten(parse_json(text), "")) for text in (first, second))
    except ValueError:
        return _find_line(first, second)
    for path in dict.fromkeys([*values, *others]):
        value, other = values.get(path, NOTHING), others.get(path, NOTHING)
        if value != other:
            return path.removeprefix("."), value, other
    return _find_line(first, second)


def _flatten(node: Any, path: str) -> Iterator[tuple[str, Any]]:
    if isinstance(node, list):
        node = dict(enumerate(node))
    if isinstance(node, dict) and node:
        for name, value in node.items():
            yield from _flatten(value, f"{path}.{name}")
    else:
        yield path, node


def _shorten(value: object) -> str:
    text = " ".join(str(value).split()) or "empty"
    return text if len(text) <= SHOWN else f"{text[: SHOWN - 3]}..."
