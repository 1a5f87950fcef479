"""The digests of the files in the folder of a run or an evaluation, ``digests.csv``.

A row is appended after its file is on the disk; the last row of a file counts. A file that grows or
is being replaced has a row without a digest. The row of a growing table covers its first line.
"""

import csv
import hashlib
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import NamedTuple

from evoros.files.disk import sync, write_atomically
from evoros.storage.file_reading import read_bytes
from evoros.storage.layout import DIGESTS
from evoros.storage.repairs import Repair, Report
from evoros.storage.seals import DIGEST, is_damaged, is_sealed, seal_rows, split_lines
from evoros.storage.tables import to_csv

HEADER = ("file", "sha256", "lines", DIGEST)
MAX_LINES = 10_000
"""Damage in longer files is noticed, and not located."""


class Entry(NamedTuple):
    """The digests of a file."""

    sha256: str  # empty: it grows or is being replaced
    lines: str  # four digits for each line, by which a damaged one is found


class Entries(NamedTuple):
    """The content of ``digests.csv``."""

    by_name: dict[str, Entry]
    damaged: list[int]  # lines
    complete: bool  # whether it ends with a line break


def describe_file(content: bytes, locate: bool = True) -> Entry:
    """Return the digests of a file; with ``locate`` those of its lines, too."""
    lines = split_lines(content) if locate else []
    shown = lines if len(lines) <= MAX_LINES else []
    return Entry(hashlib.sha256(content).hexdigest(), "".join(map(_check_line, shown)))


def describe_growing(header: bytes) -> Entry:
    """Return the entry of a growing table."""
    return Entry("", _check_line(header))


def _check_line(line: bytes) -> str:
    return f"{zlib.crc32(line) & 0xFFFF:04x}"


def find_line(content: bytes, entry: Entry) -> str:
    """Return the first line that is damaged, as ``: line 7``; empty if it is not known which."""
    lines = split_lines(content)
    known = [entry.lines[at : at + 4] for at in range(0, len(entry.lines), 4)]
    for index, check in enumerate(known):
        if index >= len(lines) or _check_line(lines[index]) != check:
            return f": line {index + 1}"
    return f": line {len(known) + 1}" if known and len(lines) > len(known) else ""


def is_whole(content: bytes, entry: Entry) -> bool:
    """Whether a file is as it was written."""
    return hashlib.sha256(content).hexdigest() == entry.sha256


def write_entries(entries: Mapping[str, Entry]) -> str:
    """Return the content of ``digests.csv`` with these entries."""
    return to_csv([HEADER]) + _seal_entries(entries).decode()


def _seal_entries(entries: Mapping[str, Entry]) -> bytes:
    return seal_rows(to_csv((name, *entry) for name, entry in entries.items()))


def read_entries(content: bytes) -> Entries:
    """Read all rows that are whole. An incomplete last one is left out."""
    header, *lines = split_lines(content) or [b""]
    entries = Entries({}, [], content.endswith(b"\n"))
    if header != to_csv([HEADER]).encode():
        entries.damaged.append(1)
    for line_number, line in enumerate(lines, 2):
        if (row := _read_entry(line)) is not None:
            name, entry = row
            entries.by_name[name] = entry
        elif is_damaged(line):
            entries.damaged.append(line_number)
    return entries


def _read_entry(line: bytes) -> tuple[str, Entry] | None:
    """Return the name of a file and its digests; None if a line has none of this folder's."""
    if not is_sealed(line):
        return None
    try:
        name, sha256, lines, _ = next(csv.reader([line.decode()]))
    except ValueError:  # other columns, or no text
        return None
    inside = not PurePath(name).is_absolute() and ".." not in PurePath(name).parts
    return (name, Entry(sha256, lines)) if inside else None


@dataclass
class DigestLog:
    """``digests.csv`` of a folder that is open for writing."""

    folder: Path
    report: Report

    def __post_init__(self) -> None:
        self._path = self.folder / DIGESTS
        self.entries, self._damaged, complete = read_entries(self._read())
        self._appendable = complete and not self._damaged

    def _read(self) -> bytes:
        return read_bytes(self._path) if self._path.is_file() else b""

    def sync(self) -> None:
        """Make the system write the rows to the disk itself."""
        sync(self._path)

    def discard(self, problem: str) -> None:
        """Forget all entries, because of a problem of the file; they are written anew."""
        self.entries, self._damaged, self._appendable = {}, [], False
        self.report(Repair(self._path, problem=problem))

    @property
    def damaged(self) -> bool:
        """Whether a row is damaged, or the file was missing."""
        return bool(self._damaged)

    def is_whole(self, name: str, content: bytes) -> bool:
        """Whether a file is known and as it was written."""
        entry = self.entries.get(name)
        return entry is not None and is_whole(content, entry)

    def add(self, entries: Mapping[str, Entry]) -> None:
        """Append the entries of files, unless they are known already."""
        new = {name: entry for name, entry in entries.items() if self.entries.get(name) != entry}
        replaces = not self.entries.keys().isdisjoint(new)
        self.entries |= new
        if not self._appendable:
            self._rewrite()
        elif new:
            with self._path.open("ab") as file:
                file.write(_seal_entries(new))
            if replaces:  # the old entry of a file must not outlast the file
                self.sync()

    def reopen(self, names: Iterable[str]) -> None:
        """Note that files are going to be replaced, so that a kill meanwhile is no damage."""
        self.add({name: Entry("", "") for name in names if name in self.entries})

    def finish(self) -> None:
        """Sort the rows, of which each file has one: equal folders have equal digests."""
        names = sorted(name for name in self.entries if (self.folder / name).is_file())
        self.entries = {name: self.entries[name] for name in names}
        if self._read() != write_entries(self.entries).encode():
            self._rewrite()

    def _rewrite(self) -> None:
        if self._damaged:
            lines = ", ".join(map(str, self._damaged))
            where = f": line {lines}" if self._path.exists() else ""
            self.report(Repair(self._path, where))
        write_atomically(self._path, write_entries(self.entries))
        self._damaged, self._appendable = [], True
