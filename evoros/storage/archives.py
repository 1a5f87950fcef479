"""Archives of studies (``evoros archive``), read as the folders that they were made from.

Nothing in an archive is run. The runs that are asked for are unpacked into a temporary folder,
which lasts as long as the process.
"""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from os import stat_result
from pathlib import Path
from tempfile import TemporaryDirectory
from zipfile import is_zipfile

from evoros.base.errors import InputError
from evoros.files.nested import parse_json
from evoros.files.resources import expand_home
from evoros.files.zipped import open_zip, read_member
from evoros.storage.discovery import MARKS

FORMAT = 1
"""The version of the layout of archives."""
RECORD = "evoros-archive.json"
"""The member that states it, with the version of evoros."""
CHECKSUMS = "checksums.sha256"
"""The member with the SHA-256 of all others, as ``sha256sum --check`` reads them."""
RUNS, INPUTS = "runs", "inputs"
"""Folders of the runs, and of the files from which they follow."""


def open_folder(path: str | Path) -> Path:
    """Return a folder, or unpack the runs of an archive and return theirs.

    ``study.zip/NAME`` is the run, or the folder of runs, NAME in the archive.

    Raises:
        InputError: the archive is damaged, is not evoros's, or has no such run.
    """
    path = expand_home(path)
    archive = find_archive(path)
    if archive is None:
        return path
    inner = path.relative_to(archive).as_posix()
    top = _unpack_runs(archive.resolve(), _identify(archive.stat()), inner)
    return _descend(top) if inner == "." else top


def open_run(path: str | Path) -> Path:
    """Return the folder of a run, or unpack it from an archive.

    Raises:
        InputError: as ``open_folder``, or the archive has several runs and none was named.
    """
    folder, archive = open_folder(path), find_archive(expand_home(path))
    if archive is not None and not is_run(folder):
        top = next(place for place in (folder, *folder.parents) if place.name == RUNS)
        names = [str(file.parent.relative_to(top)) for file in folder.rglob(MARKS[0])]
        raise InputError(
            f"{path}: must be one run, and has {len(names)}; {_advise(archive, names)}"
        )
    return folder


def find_archive(path: Path) -> Path | None:
    """Return the archive that a path leads to or into; None if it leads to none."""
    for place in (path, *path.parents):
        if place.is_file():
            return place if place.suffix == ".zip" or is_zipfile(place) else None
        if place.is_dir():
            return None
    return None


def is_run(folder: Path) -> bool:
    """Whether a folder is of a run or an evaluation, and not one above such."""
    return any((folder / name).is_file() for name in MARKS)


def _identify(status: stat_result) -> tuple[int, ...]:
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


_FOLDERS: list[TemporaryDirectory[str]] = []  # deleted when the process ends


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
        raise InputError(
            f"{archive}/{inner}: must be a run in the archive, and there is none; "
            f"{_advise(archive, names)}"
        )
    return top / wanted


def _advise(archive: Path, names: Sequence[str]) -> str:
    shown = ", ".join(f"{archive}/{name}" for name in sorted(names)[:5])
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    return f"give {shown}{more}"


def _descend(top: Path) -> Path:
    """Go down to the folder that a study was archived from: the first with several in it."""
    while not is_run(top):
        folders = [path for path in top.iterdir() if path.is_dir()]
        if len(folders) != 1:
            break
        top = folders[0]
    return top


def unpack(path: Path, wanted: Callable[[str], bool], to: Path) -> None:
    """Unpack the members that are wanted into a new folder, and compare them with their checksums.

    Raises:
        InputError: the archive is damaged or of another format, or a file cannot be written.
    """
    with open_zip(path) as (archive, members):
        for name in (RECORD, CHECKSUMS):
            if name not in members:
                raise InputError(
                    f"{path}: must have {name}, as every archive of evoros has, and it is missing; "
                    f"give a file that evoros archive wrote"
                )
        _check_record(path, read_member(path, archive, members[RECORD]))
        sums = _read_sums(path, read_member(path, archive, members[CHECKSUMS]))
        _compare_names(path, set(sums), set(members) - {CHECKSUMS})
        for name in filter(wanted, members):
            content = read_member(path, archive, members[name])
            if hashlib.sha256(content).hexdigest() != sums[name]:
                raise InputError(
                    f"{path}: {name} must be as {CHECKSUMS} states, and is another file; get the "
                    f"archive again from where it came"
                )
            write_unpacked(to / name, content)


def write_unpacked(path: Path, content: bytes) -> None:
    """Write a new file, and the folders that it lies in."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("xb") as file:
            file.write(content)
    except OSError as error:
        raise InputError(
            f"{path}: cannot be unpacked ({error.strerror}); free some space, set TMPDIR to "
            f"another folder, or choose another --output"
        ) from error


def _compare_names(path: Path, listed: set[str], present: set[str]) -> None:
    for name in sorted(listed ^ present):
        problem = "it is missing" if name in listed else f"{CHECKSUMS} does not list it"
        raise InputError(
            f"{path}: {name} must be in the archive and in {CHECKSUMS}, and {problem}; get the "
            f"archive again from where it came"
        )


def _read_sums(path: Path, content: bytes) -> dict[str, str]:
    lines = [line.partition("  ") for line in content.decode(errors="replace").splitlines()]
    if not all(len(digest) == 64 and name for digest, _, name in lines):
        raise InputError(
            f"{path}: {CHECKSUMS} must have a SHA-256 and a name in each line, and has not; get "
            f"the archive again from where it came"
        )
    return {name: digest for digest, _, name in lines}


def write_sums(digests: Mapping[str, str]) -> bytes:
    """Return the content of ``CHECKSUMS`` for the SHA-256 of each member."""
    return "".join(f"{digest}  {name}\n" for name, digest in sorted(digests.items())).encode()


def write_record(version: str) -> bytes:
    """Return the content of ``RECORD`` for a version of evoros."""
    return (json.dumps({"format_version": FORMAT, "evoros": version}, indent=2) + "\n").encode()


def _check_record(path: Path, content: bytes) -> None:
    fields: object = None
    with suppress(ValueError):
        fields = parse_json(content)
    found = fields.get("format_version") if isinstance(fields, dict) else None
    if found != FORMAT:
        version = fields.get("evoros") if isinstance(fields, dict) else None
        raise InputError(
            f"{path}: {RECORD}: format_version must be {FORMAT}, not {found!r}; read it with the "
            f"version of evoros that made it ({version!r:.40})"
        )
