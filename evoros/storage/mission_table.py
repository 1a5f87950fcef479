"""The table of the missions of a run or an evaluation, open and locked."""

import csv
import fcntl
import os
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import BinaryIO, TypeVar

import numpy as np

from evoros.base.disk import create_draft, sync
from evoros.base.errors import InputError
from evoros.storage.creation import require_whole
from evoros.storage.layout import FORMAT_VERSION, MISSIONS
from evoros.storage.tables import to_csv

Row = TypeVar("Row")


class MissionTable:
    """``missions.csv`` in a folder, which no other process can open for writing.

    ``header`` has its columns.

    Raises:
        InputError: the folder has no such table, or another process has it open.
    """

    def __init__(self, folder: Path, header: Sequence[str]) -> None:
        self.path, self._header = folder / MISSIONS, tuple(header)
        self._file: BinaryIO = _open_locked(self.path)

    def close(self) -> None:
        """Release the folder to other processes."""
        self.sync()
        self._file.close()

    def append(self, rows: Sequence[Sequence[object]]) -> None:
        """Write finished missions, which then survive a kill of this process."""
        self._file.write(to_csv(rows).encode())
        self._file.flush()

    def sync(self) -> None:
        """Make the system write the missions to the disk itself, against a loss of power."""
        self._file.flush()
        os.fsync(self._file.fileno())

    def read(self, parse: Callable[[Mapping[str, str]], Row]) -> Iterator[Row]:
        """Yield all complete rows; read to the end before appending any.

        A last row that a kill has cut short is removed. ``parse`` raises KeyError, ValueError,
        TypeError or AttributeError if a row is damaged.

        Raises:
            InputError: a row is damaged, or the columns differ.
        """
        self._file.seek(0)
        rows = csv.DictReader(self._whole_lines())
        if tuple(rows.fieldnames or ()) != self._header:
            raise InputError(
                f"{self.path}: line 1: must be the columns of format {FORMAT_VERSION}; "
                f"the file is damaged or of another version; restore it, or start a new run"
            )
        for row in rows:
            try:
                parsed = parse(row)
            except (KeyError, ValueError, TypeError, AttributeError) as error:
                raise InputError(
                    f"{self.path}: line {rows.line_num}: must be a whole row, not a "
                    f"damaged one ({error}); delete the line, and its mission runs again"
                ) from error
            yield parsed

    def _whole_lines(self) -> Iterator[str]:
        end = 0
        for line in self._file:
            if not line.endswith(b"\n"):
                break
            end += len(line)
            yield line.decode(errors="replace").rstrip("\n")
        if self._file.seek(0, os.SEEK_END) > end:
            self._file.seek(end)
            self._file.truncate()

    def sort(self, order: Callable[[Mapping[str, str]], tuple[int, ...]]) -> None:
        """Put the rows into the order of their keys, which ``order`` returns.

        It needs about 60 bytes of memory for each row.
        """
        self._file.seek(0)
        header = self._file.readline()
        offsets, keys = array("q"), array("q")
        at = len(header)
        for line in self._file:
            offsets.append(at)
            at += len(line)
            keys.extend(order(next(csv.DictReader([line.decode()], self._header))))
        columns = np.frombuffer(keys, np.int64).reshape(max(len(offsets), 1), -1).T
        ordered = np.lexsort(columns[::-1])
        if np.any(ordered[1:] < ordered[:-1]):
            self._replace(chain([header], (self._read_line(offsets[i]) for i in ordered)))

    def _read_line(self, offset: int) -> bytes:
        self._file.seek(offset)
        return self._file.readline()

    def _replace(self, lines: Iterable[bytes]) -> None:
        """Replace the table by another that is locked before it appears."""
        draft, file = create_draft(self.path)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            file.writelines(lines)
            file.flush()
            os.fsync(file.fileno())
            draft.replace(self.path)
            sync(self.path.parent)
        except BaseException:
            file.close()
            draft.unlink(missing_ok=True)
            raise
        self._file.close()
        self._file = file


def _open_locked(path: Path) -> BinaryIO:
    require_whole(path.parent)
    if not path.is_file():
        raise InputError(
            f"{path.parent}: no run to resume: it has no {MISSIONS}; give the folder of a run"
        )
    file = path.open("r+b")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if not os.path.samestat(os.fstat(file.fileno()), path.stat()):
            raise BlockingIOError("replaced meanwhile")
    except OSError as error:
        file.close()
        raise InputError(
            f"{path.parent}: another process is running in this folder; wait for it, or end it"
        ) from error
    return file
