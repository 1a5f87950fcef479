"""Reads regular files alone, and no more of them than fits into memory.

In a folder of others, a name may lead to a pipe, which would be waited for, or to a device or a
sparse file without an end.
"""

import errno
import hashlib
import os
import stat
from io import BufferedReader
from pathlib import Path

SMALL = 16 * 2**20
"""The maximum size of a file whose content is short, such as a configuration [bytes]."""
LARGE = 2**30
"""The maximum size of any other file that is read as a whole [bytes]."""
LONGEST_LINE = 2**20
"""The maximum length of a line of a table that is read line by line [bytes]."""


def open_regular(path: Path) -> BufferedReader:
    """Open a regular file for reading. It neither waits for a pipe nor follows a link.

    Raises:
        OSError: it is missing, cannot be read, or is no regular file.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW | os.O_CLOEXEC)
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise OSError(errno.EINVAL, "No regular file", str(path))
    return os.fdopen(descriptor, "rb")


def read_regular(path: Path, limit: int = LARGE) -> bytes:
    """Read a regular file of at most so many bytes.

    Raises:
        OSError: it is missing, cannot be read, is no regular file, or is larger.
    """
    with open_regular(path) as file:
        _require_size(path, os.fstat(file.fileno()).st_size, limit)
        content = file.read(limit + 1)  # it may grow meanwhile
        _require_size(path, len(content), limit)
    return content


def hash_regular(path: Path) -> str:
    """Return the SHA-256 of a regular file of at most ``LARGE`` bytes.

    Raises:
        OSError: it is missing, cannot be read, is no regular file, or is larger.
    """
    with open_regular(path) as file:
        _require_size(path, os.fstat(file.fileno()).st_size, LARGE)
        return hashlib.file_digest(file, "sha256").hexdigest()


def _require_size(path: Path, size: int, limit: int) -> None:
    if size > limit:
        raise OSError(errno.EFBIG, f"Larger than {limit // 2**20} MiB", str(path))
