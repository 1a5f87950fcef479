"""Folders of the cache that only this user can write to, for code that is run."""

import os
import tempfile
from contextlib import suppress
from pathlib import Path


def cache_home() -> str:
    """Return the folder in which programs keep what they can make again."""
    return os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")


def private_folder(name: str) -> Path | None:
    """Return a folder of evoros's cache, which exists; None if no safe one can be written.

    It is in the user's cache, or else in the folder for temporary files. Code of others must not
    be run, so that only this user may be able to write there.
    """
    for base in (
        Path(cache_home()) / "evoros",
        Path(tempfile.gettempdir()) / f"evoros-{os.getuid()}",
    ):
        folder = base / name
        with suppress(OSError):
            base.parent.mkdir(parents=True, exist_ok=True)
            for path in (base, folder):  # mkdir(parents=True) would leave the mode to the umask
                path.mkdir(exist_ok=True, mode=0o700)
            if os.access(folder, os.W_OK) and _is_private(base) and _is_private(folder):
                return folder
    return None


def _is_private(folder: Path) -> bool:
    """Whether only this user can write to the folder."""
    status = folder.stat()
    return status.st_uid == os.getuid() and not status.st_mode & 0o022
