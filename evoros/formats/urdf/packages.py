"""Finds ROS packages: declared folders, the environment, and the folder tree around a file."""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from evoros.base.errors import InputError
from evoros.files.resources import bundled_folder, expand_home

_LEVELS_UP = 3  # folders above the file's package whose packages are found
_LEVELS_DOWN = 4  # folders below each of them
_MAX_FOLDERS = 5_000  # a workspace that has more is searched in part
_SKIPPED = ("build", "install", "log", "node_modules", "site-packages")
_NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")


@dataclass(frozen=True)
class PackageIndex:
    """Where the packages are that a robot's file may name, and which folders it may read."""

    roots: tuple[Path, ...]  # folders that hold files or packages; the bundled robots come last
    folders: Mapping[str, Path]  # packages by name; of equal names the nearest
    ignored: frozenset[str] = frozenset()  # packages that are left out

    def find(self, name: str) -> Path | None:
        """Return the folder of a package; a bundled one only if there is no other of the name."""
        *own, bundled = self.roots
        for root in own:
            if root.name == name:
                return root
            if (root / name).is_dir():
                return root / name
        package = self.folders.get(name)
        if package is None and (bundled / name).is_dir():
            package = bundled / name
        return package

    def allows(self, real: Path) -> bool:
        """Return whether a real path lies in a declared folder or a package."""
        allowed = (*self.roots, *self.folders.values())
        return any(real.is_relative_to(root.resolve()) for root in allowed)


def index_packages(
    file: Path, declared: Sequence[str], ignored: Sequence[str] = ()
) -> PackageIndex:
    """Return the packages that ``file`` may name.

    They are found in the declared folders, in ``ROS_PACKAGE_PATH`` and ``AMENT_PREFIX_PATH``, and
    in the tree around the package that the file lies in: beside it, beside its parent and so on,
    ``_LEVELS_UP`` folders up.
    """
    around = [folder for folder in file.parents if (folder / "package.xml").is_file()][:1]
    roots = [file.parent, *around]
    for name in declared:
        folder = expand_home(name)
        if not folder.is_dir():
            raise InputError(f"packages: {name}: no such folder; give an existing one")
        roots.append(folder.resolve())
    roots.append(bundled_folder("robots"))
    folders: dict[str, Path] = {}
    places = [*around, *roots[len(around) + 1 : -1], *_environment_folders()]
    for package in around:
        places += [p for p in list(package.parents)[:_LEVELS_UP] if len(p.parts) > 2]
    budget = iter(range(_MAX_FOLDERS))
    for place in places:
        for package in _packages_below(place, budget):
            for name in _names_of(package):
                folders.setdefault(name, package)
    return PackageIndex(tuple(roots), folders, frozenset(ignored))


def _environment_folders() -> Iterator[Path]:
    for variable, inner in (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")):
        for entry in filter(None, os.environ.get(variable, "").split(os.pathsep)):
            if (Path(entry) / inner).is_dir():
                yield (Path(entry) / inner).resolve()


def _packages_below(folder: Path, budget: Iterator[int]) -> Iterator[Path]:
    """Yield the packages in a folder, level by level; a package contains no other."""
    level = [folder]
    for _ in range(_LEVELS_DOWN + 1):
        deeper: list[Path] = []
        for here in level:
            if next(budget, None) is None:
                return
            if (here / "package.xml").is_file():
                yield here
            else:
                deeper += _subfolders(here)
        level = deeper


def _subfolders(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as entries:
            names = [entry.name for entry in entries if entry.is_dir(follow_symlinks=True)]
    except OSError:
        return []
    return [folder / n for n in sorted(names) if not n.startswith(".") and n not in _SKIPPED]


def _names_of(package: Path) -> tuple[str, ...]:
    """Return the name that package.xml states, and the folder's own."""
    try:
        text = (package / "package.xml").read_text(encoding="utf-8", errors="replace")
    except OSError:
        text = ""
    stated = _NAME.search(text)
    return (stated[1], package.name) if stated else (package.name,)
