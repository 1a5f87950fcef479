"""The digests of the files in the folder of a run or an evaluation, ``digests.csv``.

A row is appended after its file is on the disk; the last row of a file counts. A file that grows or
is being replaced has a row without a digest, and that of a growing table covers its first line.
"""

import csv
import hashlib
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from evoros.files.disk import sync, write_atomically
from evoros.storage.layout import DIGESTS
from evoros.storage.seals import DIGEST, is_sealed, seal_rows, split_lines
from evoros.storage.tables import to_csv
from evoros.terminal.log import LOGGER

HEADER = ("file", "sha256", "lines", DIGEST)
MOST_LINES = 10_000
"""Damage in longer files is noticed, and not located."""


class Entry(NamedTuple):
    """What is known of a file."""

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
    shown = lines if len(lines) <= MOST_LINES else []
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
    for number, check in enumerate(known, 1):
        if number > len(lines) or _check_line(lines[number - 1]) != check:
            return f": line {number}"
    return f": line {len(known) + 1}" if known and len(lines) > len(known) else ""


def is_whole(content: bytes, entry: Entry) -> bool:
    """Whether a file is as it was written."""
    return hashlib.sha256(content).hexdigest() == entry.sha256


def write_entries(entries: Mapping[str, Entry]) -> str:
    """Return the content of ``digests.csv`` with these entries."""
    rows = seal_rows(to_csv((name, *entry) for name, entry in entries.items()))
    return to_csv([HEADER]) + rows.decode()


def read_entries(content: bytes) -> Entries:
    """Read all rows that are whole. An incomplete last one is left out."""
    header, *lines = split_lines(content) or [b""]
    found = Entries({}, [], content.endswith(b"\n"))
    if header != to_csv([HEADER]).encode():
        found.damaged.append(1)
    for number, line in enumerate(lines, 2):
        if is_sealed(line) and line.count(b",") >= len(HEADER) - 1:
            name, *known, _ = next(csv.reader([line.decode()]))
            found.by_name[name] = Entry(*known)
        elif line.endswith(b"\n") or is_sealed(line[:-1] + b"\n"):
            found.damaged.append(number)
    return found


@dataclass
class DigestLog:
    """``digests.csv`` of a folder that is open for writing."""

    folder: Path

    def __post_init__(self) -> None:
        self._path = self.folder / DIGESTS
        content = self._path.read_bytes() if self._path.is_file() else b""
        self.entries, self._damaged, complete = read_entries(content)
        self._appendable = complete and not self._damaged

    def sync(self) -> None:
        """Make the system write the rows to the disk itself."""
        sync(self._path)

    def get(self, name: str) -> Entry | None:
        """Return what is known of a file."""
        return self.entries.get(name)

    def is_whole(self, name: str, content: bytes) -> bool:
        """Whether a file is known and as it was written."""
        entry = self.entries.get(name)
        return entry is not None and is_whole(content, entry)

    def is_damaged(self, name: str, content: bytes) -> bool:
        """Whether a file is known, complete, and not as it was written."""
        entry = self.entries.get(name)
        return entry is not None and bool(entry.sha256) and not is_whole(content, entry)

    def add(self, entries: Mapping[str, Entry]) -> None:
        """Append what is known of files, unless it is known already."""
        new = {name: entry for name, entry in entries.items() if self.entries.get(name) != entry}
        replaces = not self.entries.keys().isdisjoint(new)
        self.entries |= new
        if not self._appendable:
            self._rewrite(self.entries)
        elif new:
            with self._path.open("ab") as file:
                file.write(seal_rows(to_csv((name, *entry) for name, entry in new.items())))
            if replaces:  # what a file was must not outlast it
                self.sync()

    def reopen(self, names: Iterable[str]) -> None:
        """Note that files are going to be replaced, so that a kill meanwhile is no damage."""
        self.add({name: Entry("", "") for name in names if name in self.entries})

    def finish(self) -> None:
        """Sort the rows, of which each file has one: equal folders have equal digests."""
        present = {name: self.entries[name] for name in sorted(self.entries)}
        self.entries = {name: e for name, e in present.items() if (self.folder / name).is_file()}
        content = self._path.read_bytes() if self._path.is_file() else b""
        if content != write_entries(self.entries).encode():
            self._rewrite(self.entries)

    def _rewrite(self, entries: Mapping[str, Entry]) -> None:
        if self._damaged:
            lines = ", ".join(map(str, self._damaged))
            problem = f"line {lines}: damaged" if self._path.exists() else "missing"
            LOGGER.warning("%s: %s; written anew as far as files are known", self._path, problem)
        write_atomically(self._path, write_entries(entries))
        self._damaged, self._appendable = [], True
