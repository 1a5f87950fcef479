"""Makes files and folders survive a loss of power."""

import errno
import os
from pathlib import Path
from typing import BinaryIO

CANNOT = (errno.EINVAL, errno.ENOTSUP)
"""What some network file systems answer for folders."""


def sync(path: Path) -> None:
    """Make the system write the content of a file, or the names in a folder, to the disk itself."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in CANNOT:
            raise
    finally:
        os.close(descriptor)


def make_folder(path: Path) -> None:
    """Create a folder and those above it, if they do not exist, so that they stay."""
    missing = [folder for folder in (path, *path.parents) if not folder.exists()]
    path.mkdir(parents=True, exist_ok=True)
    for folder in reversed(missing):
        sync(folder.parent)


def create_draft(path: Path) -> tuple[Path, BinaryIO]:
    """Open a new file beside ``path``, to be moved there; one that a kill has left is deleted."""
    draft = path.with_name(f".{path.name}.part")
    draft.unlink(missing_ok=True)
    return draft, draft.open("x+b")


def write_atomically(path: Path, content: str | bytes) -> None:
    """Replace a file's content; a kill or a loss of power leaves either the old or the new one."""
    draft, file = create_draft(path)
    try:
        with file:
            file.write(content if isinstance(content, bytes) else content.encode())
            file.flush()
            os.fsync(file.fileno())  # before the rename: a loss of power leaves no empty file
        draft.replace(path)
        sync(path.parent)
    except BaseException:  # a full disk, Ctrl-C
        draft.unlink(missing_ok=True)
        raise
