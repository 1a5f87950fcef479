"""Archives of studies, read like folders; runs are unpacked on request, for this process only."""

import hashlib
import json
import os
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from re import Match, Pattern
from tempfile import TemporaryDirectory
from zipfile import is_zipfile

from evoros.base.errors import InputError
from evoros.files.nested import parse_json
from evoros.files.resources import expand_home
from evoros.files.zipped import open_zip, read_member
from evoros.storage.layout import MARKS

FORMAT = 1  # version of the archive format
RECORD = "evoros-archive.json"  # member with the format version and the version of evoros
CHECKSUMS = (
    "checksums.sha256"  # member with the digests of all others, in the format of ``sha256sum``
)
RUNS, INPUTS = "runs", "inputs"  # folders of runs, and of their input files


def open_folder(path: str | Path) -> Path:
    """Return a folder; unpack it if the path leads into an archive, as in ``study.zip/NAME``."""
    path = expand_home(path)
    archive = find_archive(path)
    if archive is None:
        return path
    inner = path.relative_to(archive).as_posix()
    status = archive.stat()
    identity = (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns)
    top = _unpack_runs(archive.resolve(), identity, inner)
    return _descend(top) if inner == "." else top


def open_run(path: str | Path) -> Path:
    """Return the folder of a run; unpack it if the run is in an archive."""
    folder, archive = open_folder(path), find_archive(expand_home(path))
    if archive is not None and not is_run(folder):
        top = next(place for place in (folder, *folder.parents) if place.name == RUNS)
        names = [str(file.parent.relative_to(top)) for file in folder.rglob(MARKS[0])]
        raise InputError(f"{path}: not a single run; {_advise(archive, names)}")
    return folder


def find_archive(path: Path) -> Path | None:
    """Return the archive at or above a path; None if there is none."""
    for place in (path, *path.parents):
        if place.is_file():
            return place if place.suffix == ".zip" or is_zipfile(place) else None
        if place.is_dir():
            return None
    return None


def is_run(folder: Path) -> bool:
    """Return True if a folder contains a run or an evaluation."""
    return any((folder / name).is_file() for name in MARKS)


_FOLDERS: list[TemporaryDirectory[str]] = []  # deleted when this process ends


@cache
def _unpack_runs(archive: Path, identity: tuple[int, ...], inner: str) -> Path:
    folder = TemporaryDirectory(prefix="evoros-")
    _FOLDERS.append(folder)
    wanted = RUNS if inner == "." else f"{RUNS}/{inner}"
    top = Path(folder.name) / archive.name
    unpack(archive, lambda name: name.startswith(f"{wanted}/"), top)
    if not (top / wanted).is_dir():
        with open_zip(archive) as (_, members):
            files = [name for name in members if name.endswith(f"/{MARKS[0]}")]
        names = [name.removeprefix(f"{RUNS}/").rpartition("/")[0] for name in files]
        raise InputError(f"{archive}/{inner}: not found in the archive; {_advise(archive, names)}")
    return top / wanted


def _advise(archive: Path, names: Sequence[str]) -> str:
    shown = ", ".join(f"{archive}/{name}" for name in sorted(names)[:5])
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    return f"give {shown}{more}"


def _descend(top: Path) -> Path:
    """Return the folder of an archive's study: a run, or the first that holds several folders."""
    while not is_run(top):
        folders = [path for path in top.iterdir() if path.is_dir()]
        if len(folders) != 1:
            break
        top = folders[0]
    return top


def unpack(path: Path, wanted: Callable[[str], bool], to: Path) -> None:
    """Unpack the wanted members to a new folder, and verify their digests."""
    with open_zip(path) as (archive, members):
        for name in (RECORD, CHECKSUMS):
            if name not in members:
                raise InputError(f"{path}: {name} not found; give a file written by evoros archive")
        _check_record(path, read_member(path, archive, members[RECORD]))
        sums = _read_sums(path, read_member(path, archive, members[CHECKSUMS]))
        for name in sorted(set(sums) ^ (set(members) - {CHECKSUMS})):
            problem = "not found" if name in sums else f"not listed in {CHECKSUMS}"
            raise InputError(f"{path}: {name}: {problem}; download or copy the archive again")
        for name in filter(wanted, members):
            content = read_member(path, archive, members[name])
            if hashlib.sha256(content).hexdigest() != sums[name]:
                raise InputError(
                    f"{path}: {name}: checksum mismatch; download or copy the archive again"
                )
            write_unpacked(to / name, content)


def write_unpacked(path: Path, content: bytes) -> None:
    """Write a new file, and create its parent folders."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("xb") as file:
            file.write(content)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be unpacked ({error.strerror}); free some space, set TMPDIR to "
            f"another folder, or choose another --output"
        ) from error


def _read_sums(path: Path, content: bytes) -> dict[str, str]:
    lines = [line.partition("  ") for line in content.decode(errors="replace").splitlines()]
    if not all(len(digest) == 64 and name for digest, _, name in lines):
        raise InputError(
            f"{path}: {CHECKSUMS}: each line must have a SHA-256 and a name; download or copy the "
            f"archive again"
        )
    return {name: digest for digest, _, name in lines}


def write_sums(digests: Mapping[str, str]) -> bytes:
    """Return the content of ``CHECKSUMS`` for the SHA-256 of each member."""
    return "".join(f"{digest}  {name}\n" for name, digest in sorted(digests.items())).encode()


def write_record(version: str) -> bytes:
    """Return the content of ``RECORD`` for a version of evoros."""
    return (json.dumps({"format_version": FORMAT, "evoros": version}, indent=2) + "\n").encode()


def _check_record(path: Path, content: bytes) -> None:
    parsed: object = None
    with suppress(ValueError):
        parsed = parse_json(content)
    fields = parsed if isinstance(parsed, dict) else {}
    if (found := fields.get("format_version")) != FORMAT:
        raise InputError(
            f"{path}: {RECORD}: format_version must be {FORMAT}, not {found!r}; read the archive "
            f"with the version of evoros that wrote it ({fields.get('evoros')!r:.40})"
        )


# Patterns around a path, so that no part of a longer name matches.
_BEFORE, _AFTER = r"(?<![\w.~-])", r"(?![\w-]|\.\w)"


@dataclass(frozen=True)
class Relocation:
    """A mapping from full folder paths to replacements."""

    places: Mapping[str, str] = field(default_factory=dict)

    def relocate(self, text: str) -> str:
        """Replace all paths in a string, longest first."""
        named = any(path in text for path in self.places)
        return self._pattern.sub(self._replace, text) if named else text

    def relocate_bytes(self, content: bytes) -> bytes:
        """Replace all paths in the content of a text file."""
        if not any(os.fsencode(path) in content for path in self.places):
            return content
        text = content.decode(errors="surrogateescape")
        return self.relocate(text).encode(errors="surrogateescape")

    @cached_property
    def _pattern(self) -> Pattern[str]:
        paths = sorted(self.places, key=len, reverse=True)
        return re.compile(f"{_BEFORE}({'|'.join(map(re.escape, paths))})(?:(/)|{_AFTER})")

    def _replace(self, match: Match[str]) -> str:
        place = self.places[match[1]]
        if place == ".":  # relative to the folder without a prefix
            return "" if match[2] else place
        return place + (match[2] or "")


NOWHERE = Relocation()  # leaves all paths unchanged
