"""Strict CSV that was written by hand or by another program: errors with file and line."""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path

from evoros.base.errors import InputError


def read_rows(
    path: Path, needed: Sequence[str], optional: Sequence[str]
) -> Iterator[tuple[int, dict[str, str]]]:
    """The number of each line and its cells by column; white space in a cell is one blank.

    Raises:
        InputError: no such file, or a column that is not ``needed`` or ``optional``, is there
            twice, or is needed and missing.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = csv.reader(file, strict=True)
            names = [name.strip() for name in next(rows, [])]
            _check_columns(path, names, needed, optional)
            for row in rows:
                if len(row) not in (0, len(names)):
                    raise InputError(
                        f"{path}: line {rows.line_num}: must have {len(names)} cells, as the first "
                        f"line has, not {len(row)}; correct the line"
                    )
                if row:
                    cells = (" ".join(cell.split()) for cell in row)
                    yield rows.line_num, dict(zip(names, cells, strict=True))
    except FileNotFoundError:
        raise InputError(
            f"{path}: must be a CSV file of designs or the folder of a finished run, and there is "
            f"none; correct the path"
        ) from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: must be a CSV file in UTF-8 ({error}); correct it") from error


def _check_columns(
    path: Path, names: Sequence[str], needed: Sequence[str], optional: Sequence[str]
) -> None:
    all_of = ", ".join((*needed, *optional))
    for name in needed:
        if name not in names:
            raise InputError(
                f"{path}: line 1: must have the column {name}, not only "
                f"{', '.join(names) or 'nothing'}; the columns are {all_of}"
            )
    for name in names:
        if name not in (*needed, *optional) or names.count(name) > 1:
            again = "again" if names.count(name) > 1 else "which is unknown"
            raise InputError(
                f"{path}: line 1: must not have the column {name!r} {again}; the columns are "
                f"{all_of}"
            )
