"""Verifies the folder of a run or an evaluation before it is read: damage is named and not used.

A file that is missing, damaged or cannot be read is an InputError in every function.
"""

from collections.abc import Container
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.files.disk import require_no_links
from evoros.formats.sdf.closed import require_closed
from evoros.storage.digests import Entries, Entry, find_line, is_whole, read_entries
from evoros.storage.field_types import unseal
from evoros.storage.layout import (
    DIGESTS,
    MANIFEST,
    MISSIONS,
    ORIGINALS,
    STATUS,
    TRAJECTORIES,
    advise_finish,
    resume_command,
)
from evoros.storage.seals import is_damaged, is_sealed, split_lines

NEEDED = "generations/"
"""The folder of tables of which none may be missing."""
LARGE = (
    f"{TRAJECTORIES}/",
    "champion/agents/",
    "champion/robot",
    "champion/trajectory_",
    "champion/world_",
)
"""Files that only some figures need."""


def verify_folder(folder: Path) -> None:
    """Require that no table of a folder is damaged, nor what it was made from, nor any link there.

    Trajectories, robots and worlds are verified when they are read, by ``verify_file``.

    Raises:
        InputError: a file is damaged, or the table of a generation is missing; the line names it,
            and the row if it is known. Or there is a link in the folder.
    """
    require_no_links(folder)
    for name in (MANIFEST, STATUS):
        if (folder / name).is_file():
            read_sealed(folder, name)
    entries = _read_entries(folder)
    for name in entries.by_name:
        if name.startswith(NEEDED) or (not name.startswith(LARGE) and (folder / name).is_file()):
            _verify(folder, name, entries)


def list_tables(folder: Path) -> list[Path]:
    """List the tables of generations that a run has written, in their order."""
    names = _read_entries(folder).by_name
    return [folder / name for name in sorted(names) if name.startswith(NEEDED)]


def list_strays(folder: Path) -> list[Path]:
    """List the files beside the tables of generations that the run has not written."""
    files = find_strays(folder, ())  # before the digests, which a process may extend meanwhile
    written = _read_entries(folder).by_name
    return [file for file in files if str(file.relative_to(folder)) not in written]


def find_strays(folder: Path, written: Container[str]) -> list[Path]:
    """Find the files beside the tables of generations whose names are not ``written``.

    Programs that synchronize folders leave copies there, such as ``00002 (1).csv``.
    """
    files = sorted((folder / NEEDED).glob("[!.]*"))
    return [file for file in files if str(file.relative_to(folder)) not in written]


def verify_file(folder: Path, name: str) -> None:
    """Require that a file which is in ``digests.csv`` is not damaged; it may be missing."""
    entries = _read_entries(folder)
    if name in entries.by_name and (folder / name).is_file():
        _verify(folder, name, entries)


def verify_world(path: Path) -> None:
    """Require that the SDF file of a world in a folder, and those beside it, are not damaged."""
    folder = _find_folder(path)
    begin = str(path.relative_to(folder).with_suffix(""))
    for name in _read_entries(folder).by_name:
        if name.startswith(begin):
            verify_file(folder, name)
    require_closed(path)


def read_text(path: Path) -> str:
    """Read a file in a folder."""
    try:
        folder = _find_folder(path)
        verify_file(folder, str(path.relative_to(folder)))
        return path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error}); restore the file") from error


def _find_folder(path: Path) -> Path:
    """Return the folder of the run or the evaluation in which a file is."""
    for parent in path.parents:
        if (parent / DIGESTS).is_file():
            return parent
    raise InputError(
        f"{path}: must be in the folder of a run, which has a {DIGESTS}; restore that file"
    )


def _read_entries(folder: Path) -> Entries:
    entries = read_entries(read_bytes(folder / DIGESTS))
    if entries.damaged:
        raise _damaged(folder, DIGESTS, f": line {entries.damaged[0]}")
    return entries


def read_sealed(folder: Path, name: str) -> dict[str, Any]:
    """Read a sealed JSON file of a folder."""
    try:
        return unseal(name, read_bytes(folder / name))
    except ValueError as error:
        raise _damaged(folder, name, f" ({error})") from error


def _verify(folder: Path, name: str, entries: Entries) -> None:
    """Verify one file; a process that writes into the folder may replace it meanwhile."""
    entry, content = entries.by_name[name], read_bytes(folder / name)
    line = _find_damage(name, content, entry)
    if line is None:
        return
    now = _read_entries(folder)
    if now.by_name.get(name) == entry:
        raise _damaged(folder, name, line)
    _verify(folder, name, now)


def _find_damage(name: str, content: bytes, entry: Entry) -> str | None:
    """Return where a file is damaged, as ``: line 7``, or empty if unknown; None if it is whole."""
    if entry.sha256 and is_whole(content, entry):
        return None
    row = _find_row(content, entry) if name == MISSIONS else ""
    if not entry.sha256:
        return row or None
    return row or find_line(content, entry)


def _find_row(content: bytes, entry: Entry) -> str:
    """Return the first damaged line of a table of missions; an incomplete last row is none."""
    header, *lines = split_lines(content) or [b""]
    if entry.lines and find_line(header, entry):
        return ": line 1"
    for line_number, line in enumerate(lines, 2):
        if not is_sealed(line) and is_damaged(line):
            return f": line {line_number}"
    return ""


def read_bytes(path: Path) -> bytes:
    """Read a file in a folder without verifying it."""
    try:
        return path.read_bytes()
    except FileNotFoundError as error:
        folders = (folder for folder in path.parents if (folder / MANIFEST).is_file())
        raise InputError(
            f"{path}: must exist; the run is not finished, or the file was deleted; "
            f"{advise_finish(next(folders, path.parent))}"
        ) from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error}); restore the file") from error


def _damaged(folder: Path, name: str, where: str = "") -> InputError:
    fix = f"restore it or type: {resume_command(folder)}"
    if name in (MANIFEST, *ORIGINALS):
        fix = "restore it from a copy; the rest of the folder is kept"
    return InputError(
        f"{folder / name}{where}: must be as evoros wrote it, and has changed since (a bad disk, "
        f"or an editor); {fix}"
    )


def read_original(folder: Path, name: str) -> bytes:
    """Read a file that cannot be made again and has no seal."""
    content = read_bytes(folder / name)
    known = read_bytes(folder / DIGESTS) if (folder / DIGESTS).is_file() else b""
    entry = read_entries(known).by_name.get(name)  # without it, the hash in the manifest decides
    if entry is not None and not is_whole(content, entry):
        raise _damaged(folder, name, find_line(content, entry))
    return content
