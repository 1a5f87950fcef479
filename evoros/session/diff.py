"""Compares two folders of runs, evaluations or sweeps, up to the first difference."""

import csv
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import zip_longest
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError, write_count
from evoros.config.recorded import flatten_recorded
from evoros.files.nested import parse_json
from evoros.observers import protocol
from evoros.storage import layout
from evoros.storage.verification import verify_folder
from evoros.terminal.log import warn_left_out

KEYS = (("generation", "design", "world", "trial"), ("source", "design", "world", "trial"))
"""Columns that identify a mission, in a run and in an evaluation."""
FIGURES = "figures/"  # may differ between equal runs, because figures can be drawn later
SHOWN = 60  # maximum number of characters shown of a value
NOTHING = "nothing"
Key = tuple[tuple[str, str], ...]  # (column, cell) pairs that identify a mission


def compare_missions(one: Path, other: Path) -> tuple[str, int]:
    """Compare mission tables, whatever the row order; return the first difference and row count."""
    first, second = (_read_missions(folder / layout.MISSIONS) for folder in (one, other))

    def order(key: Key) -> list[tuple[int, str]]:
        return [(int(value) if value.isdecimal() else -1, value) for _, value in key]

    for key in sorted({*first, *second}, key=order):
        (line, row), (other_line, other_row) = first.get(key, (0, {})), second.get(key, (0, {}))
        if row == other_row:
            continue
        mission = ", ".join(f"{name} {value}" for name, value in key)
        if not row or not other_row:
            return f"{layout.MISSIONS}: the mission {mission} is only in {one if row else other}", 0
        column = next(c for c in [*row, *other_row] if row.get(c) != other_row.get(c))
        where = f"line {line}" + (f" and {other_line}" if line != other_line else "")
        values = _describe_values(column, one, row.get(column), other, other_row.get(column))
        return f"{layout.MISSIONS}: {where} (the mission {mission}): {values}", 0
    return "", len(first)


def _read_missions(path: Path) -> dict[Key, tuple[int, dict[str, str]]]:
    """Return the line number and the cells of each complete row, keyed by mission."""
    try:
        complete = layout.read_bytes(path).decode().rpartition("\n")[0]
        rows = csv.DictReader(complete.splitlines())
        names = next((keys for keys in KEYS if {*keys} <= {*(rows.fieldnames or ())}), None)
        if names is None:
            raise ValueError(f"line 1 must have the columns {', '.join(KEYS[0])}")
        return {tuple((n, row[n]) for n in names): (rows.line_num, row) for row in rows}
    except (ValueError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read ({error}); restore the file") from error


def find_difference(one: Path, other: Path, name: str) -> str:
    """Return the first difference between the files ``name`` in two folders, or "" if equal."""
    first, second = layout.read_bytes(one / name), layout.read_bytes(other / name)
    if first == second:
        return ""
    try:
        texts = first.decode(), second.decode()
    except UnicodeDecodeError:
        compared = enumerate(zip_longest(first, second))
        differing = next(index for index, (a, b) in compared if a != b)
        return f"{name}: byte {differing} differs between {one} and {other}"
    if name.startswith(FIGURES) and name.endswith(".csv"):
        pairs = zip((one, other), texts, strict=True)
        with suppress(csv.Error):
            if len({tuple(_read_unnamed(text, folder)) for folder, text in pairs}) == 1:
                return ""
    find = {".csv": _find_cell, ".json": _find_key}.get(Path(name).suffix, _find_line)
    place, value, other_value = find(*texts)
    return f"{name}: {_describe_values(place, one, value, other, other_value)}"


def _read_unnamed(text: str, folder: Path) -> Iterator[tuple[str, ...]]:
    rows, run = csv.reader(text.splitlines()), folder.resolve().name
    header = next(rows, [])
    yield tuple(header)
    for row in rows:
        pairs = zip_longest(header, row, fillvalue="")
        yield tuple("" if (name, cell) == ("run", run) else cell for name, cell in pairs)


def _describe_values(place: str, one: Path, first: object, other: Path, second: object) -> str:
    return f"{place} is {_shorten(first)} in {one} and {_shorten(second)} in {other}"


Difference = tuple[str, object, object]  # location, value in the first folder, value in the second


def _find_line(first: str, second: str) -> Difference:
    pairs = enumerate(zip_longest(first.split("\n"), second.split("\n")), 1)
    index, pair = next((index, pair) for index, pair in pairs if pair[0] != pair[1])
    line, other = (NOTHING if text is None else text for text in pair)
    return f"line {index}", line, other


def _find_cell(first: str, second: str) -> Difference:
    line, content, other = _find_line(first, second)
    with suppress(csv.Error):  # raised, for example, by a cell of 200,000 characters
        headers = [next(csv.reader(text.splitlines()), []) for text in (first, second)]
        if headers[0] == headers[1] and NOTHING not in (content, other):
            cells = [next(csv.reader([str(text)]), []) for text in (content, other)]
            for column, one_cell, other_cell in zip(headers[0], *cells, strict=False):
                if one_cell != other_cell:
                    return f"{line}: {column}", one_cell, other_cell
    return line, content, other


def _find_key(first: str, second: str) -> Difference:
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


COMPARED = (
    *("setting.json", "designs_in.csv", "genes_in.csv", "generations/*"),
    *("designs.csv", "worst_cases.csv", "requirements.csv", "requirements.md", "junit.xml"),
    *("champion/**/*", "trajectories/**/*", "figures/*"),
)
"""The derived files to compare, except missions, in the order in which a run writes them."""
FREE = (*protocol.FREE, "figures")
MADE_BY = (
    *("commit", "dirty", "packages", "programs", "python", "platform"),
    *("operating_system", "processor"),
)
"""Fields of the manifest that may differ between equal runs."""


@dataclass
class Diff:
    """The result of a comparison; ``difference`` describes the first difference, or is empty."""

    folders: int = 0
    files: int = 0
    missions: int = 0
    difference: str = ""
    circumstances: dict[str, None] = field(default_factory=dict)  # used as an ordered set of names


def diff_runs(one: Path, other: Path) -> Diff:
    """Compare two runs or evaluations, or two folders of them, matched by relative path."""
    diff = Diff()
    names, others = _list_runs(one), _list_runs(other)
    if (names == ["."]) != (others == ["."]):
        raise InputError(
            f"{one}, {other}: one is a run, the other contains runs; give two runs, or two folders "
            f"of runs"
        )
    for name in dict.fromkeys([*names, *others]):
        if name not in names or name not in others:
            diff.difference = f"{name}: not found in {other if name in names else one}"
        else:
            _diff_folders(one / name, other / name, diff)
        if diff.difference:
            break
    return diff


def _list_runs(path: Path) -> list[str]:
    if not path.is_dir():
        raise InputError(f"{path}: folder not found; correct the path")
    names = [str(folder.relative_to(path)) for folder in layout.folders_below(path, warn_left_out)]
    if not names:
        raise InputError(f"{path}: must be the folder of a run or a sweep; correct the path")
    return names


def _diff_folders(one: Path, other: Path, diff: Diff) -> None:
    verify_folder(one)
    verify_folder(other)
    diff.folders += 1
    for difference in _list_differences(one, other, diff):
        if difference:
            diff.difference = difference
            return
        diff.files += 1


def _list_differences(one: Path, other: Path, diff: Diff) -> Iterator[str]:
    yield _diff_configurations(one, other, diff)
    yield _diff_manifests(one, other, diff)
    difference, count = compare_missions(one, other)
    diff.missions += count
    yield difference
    for name in _list_files(one, other):
        if name.startswith(FIGURES) and name.endswith(".html"):
            continue  # pages contain the run folder, the date and versions
        absent = [folder for folder in (one, other) if not (folder / name).is_file()]
        if not absent:
            yield find_difference(one, other, name)
        elif not name.startswith(FIGURES):
            yield f"{name}: not found in {absent[0]}"


def _list_files(one: Path, other: Path) -> Iterator[str]:
    for pattern in COMPARED:
        paths = [path.relative_to(base) for base in (one, other) for path in base.glob(pattern)]
        names = sorted({str(path) for path in paths if not path.name.startswith(".")})
        yield from (name for name in names if (one / name).is_file() or (other / name).is_file())


def _diff_configurations(one: Path, other: Path, diff: Diff) -> str:
    first, second = (flatten_recorded(folder / layout.CONFIG) for folder in (one, other))
    for key in _differing(first, second):
        if key.partition(".")[0] not in FREE:
            values = [values.get(key, NOTHING) for values in (first, second)]
            return f"{layout.CONFIG}: {_describe_values(key, one, values[0], other, values[1])}"
        if key.partition(".")[0] != "observers":  # observers write no file to the run folder
            diff.circumstances[key.partition(".")[0]] = None
    return ""


def _diff_manifests(one: Path, other: Path, diff: Diff) -> str:
    first, second = (layout.read_json(folder / layout.MANIFEST) for folder in (one, other))
    same_text = layout.hash_file(one / layout.CONFIG) == layout.hash_file(other / layout.CONFIG)
    for name in _differing(first.get("sha256", {}), second.get("sha256", {})):
        if same_text or not name.startswith("configuration"):
            return f"{layout.MANIFEST}: the hash of {name} differs between {one} and {other}"
    made_by = [name for name in MADE_BY if first.get(name) != second.get(name)]
    diff.circumstances |= dict.fromkeys(made_by)
    states = [layout.read_json(folder / layout.STATUS).get("state") for folder in (one, other)]
    if states[0] != states[1]:
        diff.circumstances["state"] = None
    return ""


def _differing(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    return [key for key in dict.fromkeys([*one, *other]) if one.get(key) != other.get(key)]


def describe_diff(diff: Diff) -> str:
    """Describe the result of a comparison in one or two lines."""
    if diff.difference:
        return f"different: {diff.difference}"
    runs = f"{diff.folders} folders, " if diff.folders > 1 else ""
    lines = [
        f"equal: {runs}{write_count(diff.missions, 'mission')}, {write_count(diff.files, 'file')}"
    ]
    if diff.circumstances:
        lines.append(f"made with different {', '.join(diff.circumstances)}")
    return "\n".join(lines)
