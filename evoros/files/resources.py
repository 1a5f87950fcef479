"""The bundled folders ``conf``, ``robots`` and ``worlds``, which are links in a checkout."""

import logging
import os
from pathlib import Path

from evoros.base.errors import InputError

_LOG = logging.getLogger(__name__)
PACKAGE = Path(__file__).resolve().parents[1]  # folder of the package ``evoros``


def bundled_folder(name: str) -> Path:
    """Return the path of a bundled folder: ``conf``, ``robots`` or ``worlds``."""
    return (PACKAGE / name).resolve()


def expand_home(path: str | Path) -> Path:
    """Replace a leading ``~`` or ``~user`` with the home folder, if it is known."""
    return Path(os.path.expanduser(path))


def find_config_dir(path: str | Path) -> Path:
    """Return the full path of a user's folder of configuration groups."""
    folder = expand_home(path).resolve()
    if not folder.is_dir():
        raise InputError(f"--config-dir {path}: folder not found; create it or correct the path")
    return folder


_POINTER = b"version https://git-lfs.github.com/spec/"
_PAGES = b"<!doctype html", b"<html"


def read_file(path: Path) -> bytes:
    """Read a file that a user or a description names."""
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; correct the path") from None
    except OSError as error:
        if isinstance(error, IsADirectoryError):
            raise InputError(f"{path}: a folder, not a file; give the path of a file") from None
        fix = "change its permissions" if isinstance(error, PermissionError) else "restore it"
        raise InputError(f"{path}: cannot be read ({error.strerror}); {fix}") from error
    if content.startswith(_POINTER):
        raise InputError(
            f"{path}: is only a Git LFS pointer; to download the file, type: git lfs pull"
        )
    if content[:200].lstrip().lower().startswith(_PAGES):
        raise InputError(f"{path}: is a web page, not the file; download the raw file")
    return content


def find_file(name: str, kind: str) -> Path:
    """Find a file in the current folder or in the bundled folder ``kind``; warn if both have it."""
    path = expand_home(name)
    files = [file for file in (path, bundled_folder(kind) / path) if file.is_file()]
    if len(files) == 2 and not files[0].samefile(files[1]):
        _LOG.warning(
            "%s is used instead of %s; to use the bundled file, rename yours",
            path.resolve(),
            files[1],
        )
    if files:
        return files[0].resolve()
    raise InputError(
        f"{name}: no such file, neither in the current folder ({Path.cwd()}) nor among the bundled "
        f"{kind}; give the path of an existing file"
    )
