"""Reads files in a run folder.

All functions raise InputError for a missing, damaged, unreadable or too large file.
"""

import csv
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.files.disk import LARGE, SMALL, hash_regular, read_regular
from evoros.storage.layout import MANIFEST, ORIGINALS, advise_finish, resume_command, unseal


def read_bytes(path: Path, limit: int = LARGE) -> bytes:
    """Read a file in a folder without verifying it."""
    try:
        return read_regular(path, limit)
    except OSError as error:
        raise explain_unreadable(path, error) from error


def read_rows(path: Path) -> list[dict[str, str]]:
    """Read the rows of a table in a folder as mappings from column to cell."""
    return list(csv.DictReader(read_bytes(path).decode().splitlines()))


def hash_file(path: Path) -> str:
    """Return the SHA-256 of a file in a folder."""
    try:
        return hash_regular(path)
    except OSError as error:
        raise explain_unreadable(path, error) from error


def explain_unreadable(path: Path, error: OSError) -> InputError:
    """Return the error for a file in a folder that cannot be read."""
    if not isinstance(error, FileNotFoundError):
        return InputError(f"{path}: cannot be read ({error.strerror}); restore the file")
    folders = (folder for folder in path.parents if (folder / MANIFEST).is_file())
    return InputError(
        f"{path}: not found; the run is not finished, or the file was deleted; "
        f"{advise_finish(next(folders, path.parent))}"
    )


def read_sealed(folder: Path, name: str) -> dict[str, Any]:
    """Read a sealed JSON file of a folder."""
    try:
        return unseal(name, read_bytes(folder / name, SMALL))
    except ValueError as error:
        raise damaged(folder, name, f" ({error})") from error


def damaged(folder: Path, name: str, where: str = "") -> InputError:
    """Return the error for a damaged file of a folder."""
    fix = f"restore it or type: {resume_command(folder)}"
    if name in (MANIFEST, *ORIGINALS):
        fix = "restore it from a copy; the rest of the folder is kept"
    return InputError(
        f"{folder / name}{where}: has changed since evoros wrote it (for example, a disk fault or "
        f"an edit); {fix}"
    )
