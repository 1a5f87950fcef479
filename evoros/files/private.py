"""Private folders for cached code, which only this user can write, and hashes of secrets."""

import os
import re
import tempfile
from contextlib import suppress
from hashlib import blake2b
from pathlib import Path
from secrets import token_bytes, token_hex

SECRET = re.compile(
    r"KEYS?(?![A-Z])|TOKEN|SECRET|PASSW|PASSPHRASE|CREDENTIAL|(?<![A-Z])(PASS|PWD|PIN|AUTH)(?![A-Z])",
    re.IGNORECASE,
)
"""Matches the names of variables and keys that contain secrets."""
_ID_DIGITS = 8


def find_home() -> Path | None:
    """Return the user's home folder; None if there is none, as is common in containers."""
    home = os.path.expanduser("~")
    return Path(home) if os.path.isabs(home) else None


def cache_home() -> Path:
    """Return the user's cache folder, or a temporary folder for users without a home."""
    named, home = os.environ.get("XDG_CACHE_HOME", ""), find_home()
    # The XDG Base Directory Specification says that relative paths are ignored.
    if os.path.isabs(named):
        return Path(named)
    return _temporary_cache() if home is None else home / ".cache"


def _temporary_cache() -> Path:
    return Path(tempfile.gettempdir()) / f"evoros-{os.getuid()}"


def private_folder(name: str) -> Path | None:
    """Return a cache folder that only this user can write; None if that is impossible."""
    # Cached code is executed, so other users must not have write access.
    for base in (cache_home() / "evoros", _temporary_cache()):
        folder = base / name
        with suppress(OSError):
            base.parent.mkdir(parents=True, exist_ok=True)
            for path in (base, folder):  # mkdir(parents=True) would apply the umask to parents
                path.mkdir(exist_ok=True, mode=0o700)
            if os.access(folder, os.W_OK) and _is_private(base) and _is_private(folder):
                return folder
    return None


def keep_fonts() -> None:
    """Let matplotlib cache its font list in a private folder if the home folder is not writable."""
    home = find_home()
    if home is None or not os.access(home, os.W_OK):
        folder = private_folder("matplotlib")
        if folder is not None:
            os.environ.setdefault("MPLCONFIGDIR", str(folder))


def _is_private(folder: Path) -> bool:
    status = folder.stat()
    return status.st_uid == os.getuid() and not status.st_mode & 0o022


def hash_secret(text: str) -> str:
    """Return an identifier of the user's key, followed by a hash of a text with this key."""
    key = _read_key()
    name = blake2b(key, digest_size=_ID_DIGITS // 2).hexdigest()
    return name + blake2b(text.encode(), key=key, digest_size=16).hexdigest()


def is_other_secret(one: str, other: str) -> bool:
    """Return True if hashes made by the same user differ; False for hashes of different users."""
    return one[:_ID_DIGITS] == other[:_ID_DIGITS] and one != other


def _read_key() -> bytes:
    """Read the user's key or create it; without a folder, return a temporary key."""
    folder, new = private_folder("key"), token_bytes(32)
    if folder is None:
        return new
    path, draft = folder / "secrets", folder / token_hex(8)
    if not path.is_file():
        draft.touch(mode=0o600)
        draft.write_bytes(new)
        with suppress(FileExistsError):  # another process was faster
            try:
                os.link(draft, path)
            except PermissionError:  # the file system has no hard links
                draft.rename(path)
        draft.unlink(missing_ok=True)
    return path.read_bytes()
