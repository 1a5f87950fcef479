"""Finds the bundled folders ``conf``, ``robots`` and ``worlds``.

A checkout has them at its top, where links in the package lead; a wheel has them in the package.
"""

import logging
import os
from pathlib import Path

from evoros.base.errors import InputError

_LOG = logging.getLogger(__name__)
PACKAGE = Path(__file__).resolve().parents[1]
"""The folder of the package ``evoros`` itself."""


def bundled_folder(name: str) -> Path:
    """The path of the bundled folder ``conf``, ``robots`` or ``worlds``."""
    return (PACKAGE / name).resolve()


def expand_home(path: str | Path) -> Path:
    """Replace a leading ``~`` or ``~user`` by that home; an unknown user's stays as it is."""
    return Path(os.path.expanduser(path))


def read_file(path: Path) -> bytes:
    """Read a file that a user or a description names.

    Raises:
        InputError: it cannot be read.
    """
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; correct the path") from None
    except OSError as error:
        raise InputError(
            f"{path}: must be readable, but: {error.strerror}; change its permissions"
        ) from error


def find_file(name: str, kind: str) -> Path:
    """Find a file that a configuration names: a path, or one relative to the bundled ``kind``.

    The current folder comes first. It warns if both have the file, because a bundled robot or
    world then depends on the folder in which evoros is started.

    Raises:
        InputError: there is no such file.
    """
    path = expand_home(name)
    files = [file for file in (path, bundled_folder(kind) / path) if file.is_file()]
    if len(files) == 2 and not files[0].samefile(files[1]):
        _LOG.warning("%s: is used, and hides %s; rename it to use that", path.resolve(), files[1])
    if files:
        return files[0].resolve()
    raise InputError(
        f"{name}: no such file, neither in the current folder ({Path.cwd()}) nor among the bundled "
        f"{kind}; give the path of an existing file"
    )
