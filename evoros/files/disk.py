"""Makes files and folders survive a loss of power, and follows no link out of a folder."""

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from evoros.base.errors import InputError

CANNOT = (errno.EINVAL, errno.ENOTSUP)
"""Answers of some network file systems for folders."""
NO_RIGHTS = (errno.EACCES, errno.EPERM, errno.EROFS)
GIVE_RIGHTS = "give this user the rights to read and write there"


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


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """Open the new content of a file; a kill or a loss of power leaves either the old or the new.

    If the context ends with an error, the old content stays.
    """
    draft, file = create_draft(path)
    try:
        with file:
            yield file
            file.flush()
            os.fsync(file.fileno())  # before the rename: a loss of power leaves no empty file
        draft.replace(path)
        sync(path.parent)
    except BaseException:  # a full disk, Ctrl-C
        draft.unlink(missing_ok=True)
        raise


def write_atomically(path: Path, content: str | bytes) -> None:
    """Replace a file's content; a kill or a loss of power leaves either the old or the new one."""
    with replacing(path) as file:
        file.write(content if isinstance(content, bytes) else content.encode())


def separate(path: Path) -> None:
    """Give a file that has several names (hard links) a copy of its own, to which one may append.

    The other names may be of a backup, or of a file elsewhere to which somebody has linked.
    """
    if not path.is_file() or path.stat().st_nlink == 1:
        return
    with replacing(path) as copy, path.open("rb") as file:
        shutil.copyfileobj(file, copy)


def require_no_links(folder: Path) -> None:
    """Require that everything in a folder is a file or a folder of its own.

    The folder of somebody else may have links to files of the user; none is read, written or
    deleted through them. The folder itself may be a link.

    Raises:
        InputError: there is a symbolic link, a pipe or a device in it, or it cannot be read.
    """
    folders = [folder]
    while folders:
        with _scan(folders.pop()) as entries:
            for entry in entries:
                if entry.is_dir(follow_symlinks=False):
                    folders.append(Path(entry.path))
                elif not entry.is_file(follow_symlinks=False):
                    kind = "a symbolic link" if entry.is_symlink() else "a pipe or a device"
                    raise InputError(
                        f"{entry.path}: must be a file or a folder of its own, and is {kind}, "
                        f"which could lead out of {folder}; replace it by a copy, or delete it"
                    )


def _scan(folder: str | Path) -> "os._ScandirIterator[str]":
    try:
        return os.scandir(folder)
    except PermissionError as error:
        raise InputError(f"{folder}: cannot be read ({error.strerror}); {GIVE_RIGHTS}") from error


def exists(path: Path) -> bool:
    """Whether there is such a file or folder that this user may see."""
    try:
        return path.exists()
    except PermissionError:  # of a folder above it
        return False


def explain_rights(error: BaseException) -> str:
    """Explain in one line an error for want of rights; empty for any other error."""
    if not isinstance(error, OSError) or error.errno not in NO_RIGHTS or not error.filename:
        return ""
    return f"{error.filename}: cannot be used ({error.strerror}); {GIVE_RIGHTS}"
