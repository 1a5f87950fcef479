"""Writes files that survive power failures, and reads regular files without following links."""

import errno
import fcntl
import hashlib
import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from typing import BinaryIO

from evoros.base.errors import GIVE_RIGHTS, InputError

CANNOT = (errno.EINVAL, errno.ENOTSUP)  # errors of network file systems that cannot flush folders


def sync(path: Path) -> None:
    """Flush a file's content, or a folder's entries, to the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in CANNOT:
            raise
    finally:
        os.close(descriptor)


NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP)  # errors of file systems without locks


def lock(file: BinaryIO) -> bool:
    """Lock a file; return False on file systems without locks; raise OSError if it is locked."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
        return False
    return True


def make_folder(path: Path) -> None:
    """Create a folder with its missing parents, and flush them to the disk."""
    missing = [folder for folder in (path, *path.parents) if not folder.exists()]
    path.mkdir(parents=True, exist_ok=True)
    for folder in reversed(missing):
        sync(folder.parent)


def create_draft(path: Path) -> tuple[Path, BinaryIO]:
    """Open a new file, next to ``path``, that is to replace it; delete any leftover draft first."""
    draft = path.with_name(f".{path.name}.part")
    draft.unlink(missing_ok=True)
    return draft, draft.open("x+b")


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """Open a file for new content, which replaces the old content unless an error occurs."""
    draft, file = create_draft(path)
    try:
        with file:
            yield file
            file.flush()
            os.fsync(file.fileno())  # required before the rename: a crash could leave an empty file
        draft.replace(path)
        sync(path.parent)
    except BaseException:  # includes a full disk and Ctrl-C
        draft.unlink(missing_ok=True)
        raise


def write_atomically(path: Path, content: str | bytes) -> None:
    """Write a file atomically."""
    with replacing(path) as file:
        file.write(content if isinstance(content, bytes) else content.encode())


def separate(path: Path) -> None:
    """Replace a file that has several hard links with a copy, to which a program can append."""
    if not path.is_file() or path.stat().st_nlink == 1:
        return
    with replacing(path) as copy, path.open("rb") as file:
        shutil.copyfileobj(file, copy)


def require_no_links(folder: Path) -> None:
    """Require that a folder, or a linked folder, contains only regular files and folders."""
    # Links in another person's folder could lead to private files of the user.
    folders = [folder]
    while folders:
        with _scan(folders.pop()) as entries:
            for entry in entries:
                if entry.is_dir(follow_symlinks=False):
                    folders.append(Path(entry.path))
                elif not entry.is_file(follow_symlinks=False):
                    kind = "a symbolic link" if entry.is_symlink() else "a pipe or a device"
                    raise InputError(
                        f"{entry.path}: must be a regular file or folder, not {kind}, which "
                        f"could lead out of {folder}; replace the entry with a copy, or delete "
                        "the entry"
                    )


def _scan(folder: str | Path) -> "os._ScandirIterator[str]":
    try:
        return os.scandir(folder)
    except PermissionError as error:
        raise InputError(f"{folder}: cannot be read ({error.strerror}); {GIVE_RIGHTS}") from error


def exists(path: Path) -> bool:
    """Return True if a file or folder exists and is visible to the user."""
    try:
        return path.exists()
    except OSError:  # an inaccessible parent, or an invalid name
        return False


SMALL = 16 * 2**20  # maximum size [bytes] of a small file, such as a configuration
LARGE = 2**30  # maximum size [bytes] of other files that are read at once
LONGEST_LINE = 2**20  # maximum length [bytes] of a line in tables that are read by line


def open_regular(path: Path) -> BufferedReader:
    """Open a regular file; raise an OSError for a link, a pipe or another kind of file."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW | os.O_CLOEXEC)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(errno.EINVAL, "Not a regular file", str(path))
    return os.fdopen(descriptor, "rb")


def read_regular(path: Path, limit: int = LARGE) -> bytes:
    """Read a regular file of at most ``limit`` bytes."""
    with open_regular(path) as file:
        _require_size(path, os.fstat(file.fileno()).st_size, limit)
        content = file.read(limit + 1)  # the file may have grown
        _require_size(path, len(content), limit)
    return content


def hash_regular(path: Path) -> str:
    """Return the SHA-256 digest of a regular file of at most ``LARGE`` bytes."""
    with open_regular(path) as file:
        _require_size(path, os.fstat(file.fileno()).st_size, LARGE)
        return hashlib.file_digest(file, "sha256").hexdigest()


def _require_size(path: Path, size: int, limit: int) -> None:
    if size > limit:
        raise OSError(errno.EFBIG, f"Larger than {limit // 2**20} MiB", str(path))
