"""The open and locked mission table of a run, and the offsets of its rows."""

import csv
import hashlib
import os
from array import array
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from itertools import accumulate, chain
from pathlib import Path
from typing import BinaryIO, TypeVar

import numpy as np

from evoros.base.errors import GIVE_RIGHTS, InputError
from evoros.files.disk import LONGEST_LINE, create_draft, lock, sync, write_atomically
from evoros.mission.mission import MissionKey, Outcomes
from evoros.mission.plan import MOST_REPEATS
from evoros.storage import layout
from evoros.storage.digests import Repair, Report
from evoros.storage.tables import to_csv
from evoros.terminal.log import LOGGER

Row = TypeVar("Row")


class MissionTable:
    """The file ``missions.csv`` of a folder, locked against other writing processes.

    ``header`` holds the columns without digest, and ``key`` is the run's key for row digests. After
    all rows have been read, ``damage`` holds damaged lines by line number, counted from 1, and
    ``cut`` the incomplete last line that was removed. ``report`` receives repairs.
    """

    def __init__(self, folder: Path, header: Sequence[str], key: bytes, report: Report) -> None:
        self.path, self._columns, self._key = folder / layout.MISSIONS, tuple(header), key
        self.header = begin_table(self._columns).encode()  # first line
        self.damage: dict[int, bytes] = {}
        self.cut: dict[int, bytes] = {}
        self._last = 1, b""  # number and content of the last row read
        self.place = 0  # offset of this row
        if not self.path.exists() and (folder / layout.LOG).is_file():
            report(Repair(self.path))
            write_atomically(self.path, self.header)
        self._file: BinaryIO = open_locked(self.path)

    def close(self) -> None:
        """Release the lock on the folder."""
        self.sync()
        self._file.close()

    def append(self, rows: Sequence[Sequence[object]]) -> list[int]:
        """Write missions so that they survive a kill; return the offset of each row."""
        content = layout.seal_rows(to_csv(rows), self._key)
        end = self._file.seek(0, os.SEEK_END)
        self._file.write(content)
        self._file.flush()
        lengths = [len(line) for line in layout.split_lines(content)]
        return list(accumulate(lengths[:-1], initial=end))

    def sync(self) -> None:
        """Flush the missions to disk, so that they survive a power failure."""
        self._file.flush()
        os.fsync(self._file.fileno())

    def read(self, parse: Callable[[Mapping[str, str]], Row]) -> Iterator[Row]:
        """Yield all undamaged rows; must be exhausted before rows are appended.

        A truncated last row is removed. ``parse`` raises KeyError or ValueError for a row of
        another run.
        """
        self._file.seek(0)
        header, end = self._file.readline(LONGEST_LINE), 0
        at = len(header)
        for line_number, line in enumerate(self._read_lines(), 2):
            if layout.is_sealed(line, self._key):
                self._last, self.place = (line_number, line), at
                yield self._parse(parse)
            elif layout.is_damaged(line, self._key):
                self.damage[line_number] = line
            else:
                end, self.cut = at, {line_number: line}
            at += len(line)
        if header != self.header:
            self.damage[1] = header
        if end:
            self._file.truncate(end)

    def _read_lines(self) -> Iterator[bytes]:
        while line := self._file.readline(LONGEST_LINE):
            if len(line) == LONGEST_LINE:
                raise InputError(
                    f"{self.path}: a line has more than {LONGEST_LINE - 1} bytes; restore the "
                    "file from a copy, or delete the file to rerun all missions"
                )
            yield line

    def read_row(self, place: int, parse: Callable[[Mapping[str, str]], Row]) -> Row:
        """Read the row at an offset."""
        line = self._read_line(place)
        if not layout.is_sealed(line, self._key):
            raise InputError(
                f"{self.path}: damaged at byte {place} after it was opened, for example by a disk "
                f"fault or an editor; resume the run to repair the file"
            )
        return parse(self._split(line))

    def reject(self) -> None:
        """Mark the last row read as damaged, so that its mission runs again."""
        line_number, line = self._last
        self.damage[line_number] = line

    def _parse(self, parse: Callable[[Mapping[str, str]], Row]) -> Row:
        line_number, line = self._last
        try:
            return parse(self._split(line))
        except (KeyError, ValueError) as error:
            raise InputError(
                f"{self.path}: line {line_number}: this version cannot read the row; restore "
                f"the file, or use the version that made the run"
            ) from error

    def _split(self, line: bytes) -> dict[str, str]:
        cells = next(csv.reader([line.decode()]))
        return dict(zip(self._columns, cells[:-1], strict=True))

    def mend(self) -> None:
        """Remove all damaged lines, so that their missions run again."""
        self._file.seek(0)
        damage = {1, *self.damage}  # the header is rewritten as well
        whole = (line for count, line in enumerate(self._file, 1) if count not in damage)
        self._replace(chain([self.header], whole))
        self.damage = {}

    def take_out(self, places: Collection[int]) -> dict[int, bytes]:
        """Remove the rows at given offsets; return them by line number."""
        self._file.seek(0)
        taken, at = dict[int, bytes](), 0
        for line_number, line in enumerate(self._read_lines(), 1):
            if at in places:
                taken[line_number] = line
            at += len(line)
        self._file.seek(0)
        self._replace(line for count, line in enumerate(self._file, 1) if count not in taken)
        return taken

    def sort(self, order: Callable[[Mapping[str, str]], tuple[int, ...]]) -> None:
        """Sort the rows by the keys returned by ``order``; uses about 60 bytes per row."""
        self._file.seek(0)
        header = self._file.readline()
        offsets, keys = array("q"), array("q")
        at = len(header)
        for line in self._file:
            offsets.append(at)
            at += len(line)
            keys.extend(order(self._split(line)))
        columns = np.frombuffer(keys, np.int64).reshape(max(len(offsets), 1), -1).T
        ordered = np.lexsort(columns[::-1])
        if np.any(ordered[1:] < ordered[:-1]):
            self._replace(chain([header], (self._read_line(offsets[i]) for i in ordered)))

    def _read_line(self, offset: int) -> bytes:
        self._file.seek(offset)
        return self._file.readline()

    def _replace(self, lines: Iterable[bytes]) -> None:
        """Replace the table with a new file, which is locked before it is renamed."""
        draft, file = create_draft(self.path)
        try:
            lock(file)
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

    def hash(self) -> str:
        """Return the SHA-256 of the file."""
        with self.path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()


def begin_table(columns: Sequence[str]) -> str:
    """Return the header of ``missions.csv``."""
    return to_csv([[*columns, layout.DIGEST]])


def open_locked(path: Path) -> BinaryIO:
    """Open a mission table for reading and writing by this process only."""
    if not all(os.access(place, os.R_OK | os.W_OK) for place in (path.parent, path)):
        raise InputError(
            f"{path.parent}: must be writable by this user, even to verify a finished run; "
            f"{GIVE_RIGHTS}, or copy the folder and use the copy"
        )
    file = path.open("r+b")
    try:
        if not lock(file):
            LOGGER.warning(
                "%s: is on a file system without locks; run no other process in this folder",
                path.parent,
            )
        if not os.path.samestat(os.fstat(file.fileno()), path.stat()):
            raise BlockingIOError("replaced by another process")
    except OSError as error:
        file.close()
        raise InputError(
            f"{path.parent}: another process is running in this folder; wait for it, or end it"
        ) from error
    return file


Recorded = tuple[MissionKey, str, Outcomes]  # key, conditions and outcomes of a mission
GENERATION, DESIGN = 0, 1  # indices in a mission's key used for grouping rows


class MissionRows:
    """The offsets of mission rows, and the outcomes in the current group of rows.

    Each mission uses 9 bytes of memory. The rows of a group have the same value at index ``group``
    of the key: the generation in a search, the design in an evaluation.
    """

    def __init__(self, read_row: Callable[[int], Recorded], group: int = GENERATION) -> None:
        self._read_row, self._group = read_row, group
        self.worlds: set[str] = set()  # names of worlds with missions
        self.trials = 0  # maximum number of missions in a world, without stated conditions
        self._places: dict[int, array[int]] = {}  # offsets by group
        self._wanted: dict[int, bytearray] = {}  # 1 for each requested row
        self._in_use = -1  # current group
        self._outcomes: dict[MissionKey, tuple[str, Outcomes]] = {}  # rows of the current group
        self._ranks: dict[MissionKey, int] = {}  # positions of these rows

    def __len__(self) -> int:
        return sum(map(len, self._places.values()))

    def find(self, key: MissionKey) -> tuple[str, Outcomes] | None:
        """Return the conditions and outcomes of a mission, or None if not recorded."""
        group = self._find_group(key)
        if group != self._in_use:
            rows = map(self._read_row, self._places.get(group, ()))
            self._outcomes = {key: (draws, outcomes) for key, draws, outcomes in rows}
            self._ranks = {key: rank for rank, key in enumerate(self._outcomes)}
            self._in_use = group
        if key in self._ranks:
            self._wanted[group][self._ranks[key]] = True
        return self._outcomes.get(key)

    def find_unwanted(self) -> Iterator[int]:
        """Yield the offsets of rows that have not been requested."""
        for group, places in self._places.items():
            wanted = self._wanted[group]
            yield from (place for place, asked in zip(places, wanted, strict=True) if not asked)

    def note(self, key: MissionKey, place: int) -> None:
        """Store the offset of a row that has been read."""
        *_, world, trial = key
        group = self._find_group(key)
        self.worlds.add(world)
        if trial < MOST_REPEATS:
            self.trials = max(self.trials, trial + 1)
        self._places.setdefault(group, array("q")).append(place)
        self._wanted.setdefault(group, bytearray()).append(False)

    def add(self, rows: Sequence[Recorded], places: Sequence[int]) -> None:
        """Add rows just written at the given offsets."""
        for (key, draws, outcomes), place in zip(rows, places, strict=True):
            self.note(key, place)
            group = self._find_group(key)
            self._wanted[group][-1] = True
            if group == self._in_use:
                self._outcomes[key] = (draws, outcomes)
                self._ranks[key] = len(self._ranks)

    def _find_group(self, key: MissionKey) -> int:
        generation, design, *_ = key
        return design if self._group == DESIGN else generation
