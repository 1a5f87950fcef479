"""Finds the bundled folders ``conf``, ``robots`` and ``worlds``, in a checkout and in a wheel."""

from pathlib import Path

from evoros.base.errors import InputError

PACKAGE = Path(__file__).resolve().parents[1]
"""The folder of the package ``evoros`` itself."""


def bundled_folder(name: str) -> Path:
    """The path of the bundled folder ``conf``, ``robots`` or ``worlds``."""
    installed = PACKAGE / name
    return installed if installed.is_dir() else PACKAGE.parent / name


def find_file(name: str, kind: str) -> Path:
    """Find a file that a configuration names: a path, or one relative to the bundled ``kind``.

    Raises:
        InputError: there is no such file.
    """
    path = Path(name).expanduser()
    for candidate in (path, bundled_folder(kind) / path):
        if candidate.is_file():
            return candidate.resolve()
    raise InputError(
        f"{name}: no such file, neither in the current folder ({Path.cwd()}) nor among the bundled "
        f"{kind}; give the path of an existing file"
    )
