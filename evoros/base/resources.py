"""Finds ``conf``, ``robots`` and ``worlds``, in a checkout and in an installed wheel alike."""

from pathlib import Path

from evoros.base.errors import InputError

PACKAGE = Path(__file__).resolve().parents[1]
"""The folder of the package ``evoros`` itself."""


def bundled_folder(name: str) -> Path:
    """The bundled folder ``conf``, ``robots`` or ``worlds``."""
    installed = PACKAGE / name
    return installed if installed.is_dir() else PACKAGE.parent / name


def find_file(name: str, kind: str) -> Path:
    """The file that a configuration names: as a path, or relative to the bundled folder ``kind``.

    Raises:
        InputError: there is no such file.
    """
    path = Path(name).expanduser()
    for candidate in (path, bundled_folder(kind) / path):
        if candidate.is_file():
            return candidate.resolve()
    raise InputError(
        f"{name}: no such file, neither from here ({Path.cwd()}) nor among the bundled {kind}; "
        f"give the path of an existing file"
    )
