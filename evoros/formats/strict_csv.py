"""Reads CSV files from people or other programs strictly; each error states file and line."""

import csv
from collections.abc import Iterator, Sequence
from io import StringIO
from pathlib import Path

from evoros.base.errors import InputError
from evoros.files.resources import read_file
from evoros.formats.strict_xml import quote


def read_rows(
    path: Path, required: Sequence[str], optional: Sequence[str]
) -> Iterator[tuple[int, dict[str, str]]]:
    """Yield each line's number, and its cells by column name.

    White space inside a cell is reduced to single blanks; empty lines are skipped.
    """
    try:
        rows = csv.reader(StringIO(read_file(path).decode("utf-8-sig"), newline=""), strict=True)
        names = [name.strip() for name in next(rows, [])]
        _check_columns(path, names, required, optional)
        for row in rows:
            if len(row) not in (0, len(names)):
                raise InputError(
                    f"{path}: line {rows.line_num}: must have {len(names)} cells, like the "
                    f"first line, not {len(row)}; add or delete cells"
                )
            if row:
                cells = (" ".join(cell.split()) for cell in row)
                yield rows.line_num, dict(zip(names, cells, strict=True))
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: must be a CSV file in UTF-8 ({error}); convert it") from error


def _check_columns(
    path: Path, names: Sequence[str], required: Sequence[str], optional: Sequence[str]
) -> None:
    known = ", ".join((*required, *optional))
    for name in required:
        if name not in names:
            raise InputError(
                f"{path}: line 1: must have the column {name}, but has "
                f"{quote(', '.join(names)) if any(names) else 'none'}; the columns are {known}"
            )
    for name in names:
        if name not in (*required, *optional) or names.count(name) > 1:
            problem = "repeats the" if names.count(name) > 1 else "has the unknown"
            raise InputError(
                f"{path}: line 1: {problem} column {quote(name)}; the columns are {known}"
            )
