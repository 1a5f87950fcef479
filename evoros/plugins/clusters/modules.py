"""The user's Python modules, packed for workers that cannot see their folders."""

import importlib.machinery
import io
import sys
import sysconfig
import zipfile
from collections.abc import Iterator
from pathlib import Path
from threading import Lock

from evoros.base.errors import InputError
from evoros.executor.payload import Shared

MAX_BYTES = 64 * 2**20
"""Maximum size of all modules; a larger folder holds something other than code."""
_OURS = ("evoros", "__main__")
_NEVER = ("__pycache__",)
_EPOCH = (1980, 1, 1, 0, 0, 0)


class UserModules:
    """Modules that this process has imported from the user's folders, and their neighbours.

    Their files are read once, so that a run keeps the code that it began with.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._known = 0  # number of all imported modules when the archive was made
        self._files: dict[str, bytes] = {}  # keyed by name in the archive
        self._folders: list[Path] = []
        self._archive: Shared | None = None

    def pack(self) -> Shared | None:
        """Return the archive of all modules imported so far, or None if there are none.

        Raises:
            InputError: they are too large or unreadable.
        """
        with self._lock:
            if len(sys.modules) != self._known:
                self._known = len(sys.modules)
                before = len(self._files)
                self._add_new()
                if len(self._files) != before:
                    self._archive = self._write()
            return self._archive

    def _add_new(self) -> None:
        for folder, file in sorted(set(_list_files())):
            if folder not in self._folders:
                self._folders.append(folder)
            name = f"{self._folders.index(folder)}/{file.relative_to(folder).as_posix()}"
            if name in self._files:
                continue
            try:
                self._files[name] = file.read_bytes()
            except OSError as error:
                raise InputError(
                    f"{file}: must be readable to be sent to workers ({error.strerror}); "
                    f"change its permissions or move it out of {folder}"
                ) from error
            if sum(map(len, self._files.values())) > MAX_BYTES:
                raise InputError(
                    f"{folder}: the modules sent to workers must have at most "
                    f"{MAX_BYTES >> 20} MiB, and {file} exceeds that; move your modules into a "
                    f"separate folder"
                )

    def _write(self) -> Shared:
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in sorted(self._files.items()):
                archive.writestr(zipfile.ZipInfo(name, _EPOCH), content)
        return Shared.of(buffer.getvalue())


def unpack_modules(archive: bytes, folder: Path) -> list[str]:
    """Unpack an archive into an empty folder and return the folders to import from."""
    with zipfile.ZipFile(io.BytesIO(archive)) as packed:
        packed.extractall(folder)
    return [str(path) for path in sorted(folder.iterdir(), key=lambda path: int(path.name))]


def _list_files() -> Iterator[tuple[Path, Path]]:
    """Yield each file to send, after the folder of ``sys.path`` that it is imported from."""
    for name, module in list(sys.modules.items()):
        file = getattr(module, "__file__", None)
        top = name.partition(".")[0]
        if file is None or top in _OURS or _is_installed(Path(file)):
            continue
        source = Path(file).resolve()
        for entry in sys.path:
            folder = Path(entry or ".").resolve()
            place = folder / name.replace(".", "/")
            if source not in (place.with_suffix(".py"), place / "__init__.py"):
                continue
            if source == place.with_suffix(".py"):  # it may import neighbouring modules later
                near = (path for path in folder.glob("*.py") if path.is_file())
                yield from ((folder, p) for p in near if p.stem not in sys.stdlib_module_names)
            if (folder / top).is_dir():
                yield from ((folder, path) for path in _list_package(folder / top))
            break


def _list_package(folder: Path) -> Iterator[Path]:
    """Yield all files of a package, including its data files."""
    for path in folder.iterdir():
        if path.name.startswith(".") or path.name in _NEVER:
            continue
        if path.is_dir() and not path.is_symlink():
            yield from _list_package(path)
        elif path.is_file():
            yield path


def _is_installed(file: Path) -> bool:
    if file.suffix not in importlib.machinery.SOURCE_SUFFIXES:
        return True
    if {"site-packages", "dist-packages"} & set(file.parts):
        return True
    return any(file.is_relative_to(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib"))
