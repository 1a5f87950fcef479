"""The digests of files in a run folder (``digests.csv``).

The last row of each file is valid; the row of a growing table covers only its first line.
"""

import csv
import hashlib
import zlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any, NamedTuple

from evoros.base.errors import InputError
from evoros.files.disk import sync, write_atomically
from evoros.storage.layout import (
    CONFIG,
    DIGEST,
    DIGESTS,
    MANIFEST,
    ORIGINALS,
    damaged,
    hash_file,
    is_damaged,
    is_sealed,
    read_bytes,
    resume_command,
    seal_rows,
    split_lines,
)
from evoros.storage.tables import to_csv


@dataclass(frozen=True)
class Repair:
    """A repaired file; the file was missing if only ``path`` is set."""

    path: Path
    where: str = ""  # damaged lines if known, such as ": line 3, 7"
    kept: Path | None = None  # copy of the damaged content
    problem: str = ""  # the problem, if the file was neither missing nor damaged


Report = Callable[[Repair], object]


def ignore(repair: Repair) -> None:
    """Do nothing."""


HEADER = ("file", "sha256", "lines", DIGEST)
MAX_LINES = 10_000  # maximum number of lines of a file in which damaged lines are located


class Entry(NamedTuple):
    """The digests of a file."""

    sha256: str  # empty for files that grow or are being replaced
    lines: str  # four digits per line, for locating damaged lines


class Entries(NamedTuple):
    """The content of ``digests.csv``."""

    by_name: dict[str, Entry]
    damaged: list[int]  # line numbers
    complete: bool  # whether the content ends with a newline


def describe_file(content: bytes, locate: bool = True) -> Entry:
    """Return the digests of a file, with digests per line if ``locate``."""
    lines = split_lines(content) if locate else []
    shown = lines if len(lines) <= MAX_LINES else []
    return Entry(hashlib.sha256(content).hexdigest(), "".join(map(_check_line, shown)))


def describe_growing(header: bytes) -> Entry:
    """Return the digests of a growing table."""
    return Entry("", _check_line(header))


def _check_line(line: bytes) -> str:
    return f"{zlib.crc32(line) & 0xFFFF:04x}"


def find_line(content: bytes, entry: Entry) -> str:
    """Return the location of the first damaged line, such as ``: line 7``; empty if unknown."""
    lines = split_lines(content)
    known = [entry.lines[at : at + 4] for at in range(0, len(entry.lines), 4)]
    for index, check in enumerate(known):
        if index >= len(lines) or _check_line(lines[index]) != check:
            return f": line {index + 1}"
    return f": line {len(known) + 1}" if known and len(lines) > len(known) else ""


def is_whole(content: bytes, entry: Entry) -> bool:
    """Return True if the content of a file is undamaged."""
    return hashlib.sha256(content).hexdigest() == entry.sha256


def write_entries(entries: Mapping[str, Entry]) -> str:
    """Return the content of ``digests.csv`` for these entries."""
    return to_csv([HEADER]) + _seal_entries(entries).decode()


def _seal_entries(entries: Mapping[str, Entry]) -> bytes:
    return seal_rows(to_csv((name, *entry) for name, entry in entries.items()))


def read_entries(content: bytes) -> Entries:
    """Read all undamaged rows except an incomplete last row."""
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
    if not is_sealed(line):
        return None
    try:
        name, sha256, lines, _ = next(csv.reader([line.decode()]))
    except ValueError:  # wrong encoding or number of columns
        return None
    inside = not PurePath(name).is_absolute() and ".." not in PurePath(name).parts
    return (name, Entry(sha256, lines)) if inside else None


@dataclass
class DigestLog:
    """The file ``digests.csv`` of a folder open for writing."""

    folder: Path
    report: Report

    def __post_init__(self) -> None:
        self._path = self.folder / DIGESTS
        self.entries, self._damaged, complete = read_entries(self._read())
        self._appendable = complete and not self._damaged

    def _read(self) -> bytes:
        return read_bytes(self._path) if self._path.is_file() else b""

    def sync(self) -> None:
        """Flush the rows to the disk."""
        sync(self._path)

    def discard(self, problem: str) -> None:
        """Discard all entries because of a problem in the file, which is then rewritten."""
        self.entries, self._damaged, self._appendable = {}, [], False
        self.report(Repair(self._path, problem=problem))

    @property
    def damaged(self) -> bool:
        """True if a row is damaged or if the file was missing."""
        return bool(self._damaged)

    def is_whole(self, name: str, content: bytes) -> bool:
        """Return True if a file has an entry and is undamaged."""
        entry = self.entries.get(name)
        return entry is not None and is_whole(content, entry)

    def add(self, entries: Mapping[str, Entry]) -> None:
        """Append new and changed entries."""
        new = {name: entry for name, entry in entries.items() if self.entries.get(name) != entry}
        replaces = not self.entries.keys().isdisjoint(new)
        self.entries |= new
        if not self._appendable:
            self._rewrite()
        elif new:
            with self._path.open("ab") as file:
                file.write(_seal_entries(new))
            if replaces:  # an old entry must not outlive the old file
                self.sync()

    def reopen(self, names: Iterable[str]) -> None:
        """Mark files as being replaced, so that they do not count as damaged after a kill."""
        self.add({name: Entry("", "") for name in names if name in self.entries})

    def finish(self) -> None:
        """Sort the rows and keep one per file, so that equal folders have equal digests."""
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


FOREIGN = "from another run"
_HASHES = {CONFIG: "configuration"}  # name of a file's digest in the manifest, if different


def find_foreign(
    folder: Path, manifest: Mapping[str, Any], entries: Mapping[str, Entry]
) -> str | None:
    """Return MANIFEST or DIGESTS if that file belongs to a different run, otherwise None."""
    hashes = manifest.get("sha256", {})
    for name in ORIGINALS:
        entry, recorded = entries.get(name), hashes.get(_HASHES.get(name, name))
        if entry is None or recorded in (None, entry.sha256) or not (folder / name).is_file():
            continue
        actual = hash_file(folder / name)
        if actual in (entry.sha256, recorded):
            return MANIFEST if actual == entry.sha256 else DIGESTS
    return None


def require_origin(folder: Path, manifest: Mapping[str, Any], entries: Mapping[str, Entry]) -> None:
    """Check that the manifest and the digests of a folder belong to its run."""
    foreign = find_foreign(folder, manifest, entries)
    if foreign is None:
        return
    others = f"the other files agree with {MANIFEST if foreign == DIGESTS else DIGESTS}"
    fix = "restore it from a copy, and leave the other files as they are"
    if foreign == DIGESTS:
        fix = f"restore it or type: {resume_command(folder)}"
    raise InputError(f"{folder / foreign}: the file is {FOREIGN} ({others}); {fix}")


def read_original(folder: Path, name: str, manifest: Mapping[str, Any]) -> bytes:
    """Read a file that cannot be regenerated and is not sealed."""
    content = read_bytes(folder / name)
    known = read_bytes(folder / DIGESTS) if (folder / DIGESTS).is_file() else b""
    entries = read_entries(known).by_name
    foreign = find_foreign(folder, manifest, entries)
    if foreign == MANIFEST:
        require_origin(folder, manifest, entries)
    entry = entries.get(name)  # callers compare the digest in the manifest if there is no entry
    if entry is not None and foreign is None and not is_whole(content, entry):
        raise damaged(folder, name, find_line(content, entry))
    return content
