"""Finds the bundled folders ``conf``, ``robots`` and ``worlds``, in a checkout and in a wheel."""

import os
from pathlib import Path

from evoros.base.errors import InputError

PACKAGE = Path(__file__).resolve().parents[1]
"""The folder of the package ``evoros`` itself."""


def bundled_folder(name: str) -> Path:
    """The path of the bundled folder ``conf``, ``robots`` or ``worlds``."""
    installed = PACKAGE / name
    return installed if installed.is_dir() else PACKAGE.parent / name


def expand_home(path: str | Path) -> Path:
    """Replace a leading ``~`` or ``~user`` by that home; an unknown user's stays as it is."""
    return Path(os.path.expanduser(path))


def find_file(name: str, kind: str) -> Path:
    """Find a file that a configuration names: a path, or one relative to the bundled ``kind``.

    Raises:
        InputError: there is no such file.
    """
    path = expand_home(name)
    for candidate in (path, bundled_folder(kind) / path):
        if candidate.is_file():
            return candidate.resolve()
    raise InputError(
        f"{name}: no such file, neither in the current folder ({Path.cwd()}) nor among the bundled "
        f"{kind}; give the path of an existing file"
    )
