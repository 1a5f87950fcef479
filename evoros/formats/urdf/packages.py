"""Locates ROS packages in declared folders, the environment, and folders around a file.

This module also finds files that have moved: ``$(find NAME)/x`` is a path in the installed package,
which ``install(DIRECTORY description/x DESTINATION share/NAME)`` in CMakeLists.txt fills from
another folder. Names from case-insensitive systems often differ in upper and lower case, such
as ``Barrel.DAE`` for ``barrel.dae``.
"""

import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path, PurePosixPath

from evoros.base.errors import InputError
from evoros.files.resources import bundled_folder, expand_home

_LEVELS_UP = 3  # minimum number of folders searched above the file's package
_LEVELS_DOWN = 4  # number of folder levels searched below each folder
_MAX_FOLDERS = 5_000  # maximum number of folders searched
_SKIPPED = ("build", "install", "log", "node_modules", "site-packages")
_MANIFESTS = ("package.xml", "manifest.xml")  # the older, until 2012, lacks names
_IGNORED = {"COLCON_IGNORE", "AMENT_IGNORE", "CATKIN_IGNORE"}
_SPACES = ("src", "install", "devel")  # folders of packages in a workspace
_INDEX = "ament_index/resource_index/packages"  # folder in ``share`` with a file per package
_FIND = re.compile(r"\$\(find(?:-pkg-share)? +([^)$\s]+)\)/([^\"'<>$]+)")
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")


@dataclass(frozen=True)
class PackageIndex:
    """Locations of the packages that a robot's file may name, and folders that may be read."""

    roots: tuple[Path, ...]  # folders with files or packages; bundled robots are last
    folders: Mapping[str, Path]  # packages by stated name; the nearest of several with one name
    ignored: frozenset[str] = frozenset()  # packages to be left out

    def find(self, name: str) -> Path | None:
        """Return the folder of a package by stated name or, failing that, by folder name."""
        beside = (folder for root in self.roots for folder in (root, root / name))
        bearing = (folder for folder in beside if folder.name == name and folder.is_dir())
        return self.folders.get(name) or next(bearing, None)

    def allows(self, real: Path) -> bool:
        """Return True if a resolved path is inside a declared folder or a package."""
        allowed = (*self.roots, *self.folders.values())
        return any(real.is_relative_to(root.resolve()) for root in allowed)


def index_packages(
    file: Path, declared: Sequence[str], ignored: Sequence[str] = ()
) -> PackageIndex:
    """Return the packages that ``file`` may name, keyed by the name in package.xml.

    Packages are searched for in the declared folders, in ``ROS_PACKAGE_PATH`` and
    ``AMENT_PREFIX_PATH``, and in folders above the package that contains the file, up to
    ``_LEVELS_UP`` levels or the root of the workspace. Installed packages come last. For a file
    outside any package, only its folder and a workspace are searched.
    """
    around = [f for f in file.parents if any((f / name).is_file() for name in _MANIFESTS)][:1]
    given = list(map(_require_folder, declared))
    climbed = list(_climb(around[0], _LEVELS_UP) if around else _climb(file, 1))
    installed = [folder / "install" for folder in climbed if (folder / "install").is_dir()]
    places = (*around, *given, *_environment_folders(), *climbed, *installed)
    search = _Search(given)
    for place in places:
        level = [place]
        for _ in range(_LEVELS_DOWN + 1):
            level = [deeper for here in level for deeper in search.look_into(here, place)]
    roots = (file.parent, *around, *given, bundled_folder("robots"))
    folders = {**({} if around else _find_unstated(file)), **search.bearing, **search.stated}
    return PackageIndex(roots, folders, frozenset(ignored))


def _find_unstated(file: Path) -> dict[str, Path]:
    """Return the folders above a file that contain its package paths, by package name."""
    try:
        named = _FIND.findall(file.read_text(encoding="utf-8", errors="replace"))
    except OSError:
        return {}
    above = [(name, f) for name, inner in named for f in _climb(file, 3) if (f / inner).is_file()]
    return dict(reversed(above))


def _require_folder(name: str) -> Path:
    folder = expand_home(name)
    if not folder.is_dir():
        raise InputError(f"packages: {name}: no such folder; give an existing one")
    return folder.resolve()


def _climb(start: Path, levels: int) -> Iterator[Path]:
    """Yield ``levels`` folders above a path, and further folders up to the root of a workspace."""
    above = list(start.parents)
    tops = [level for level, folder in enumerate(above, 1) if folder.name in _SPACES]
    for folder in above[: max([levels, *(top + 1 for top in tops)])]:
        if len(folder.parts) > 2:
            yield folder


def _environment_folders() -> Iterator[Path]:
    for variable, inner in (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")):
        for entry in filter(None, os.environ.get(variable, "").split(os.pathsep)):
            if (Path(entry) / inner).is_dir():
                yield (Path(entry) / inner).resolve()


class _Search:
    """Collects packages by name; keeps the first of several with one name."""

    def __init__(self, given: Sequence[Path]) -> None:
        self.stated: dict[str, Path] = {}  # keyed by the name in package.xml or in an index
        self.bearing: dict[str, Path] = {}  # keyed by folder name
        self._given = given  # packages even without package.xml, like their subfolders
        self._seen: set[Path] = set()

    def look_into(self, here: Path, place: Path) -> list[Path]:
        """Collect ``here`` if it is a package; return the folders to search next."""
        if here in self._seen or len(self._seen) >= _MAX_FOLDERS:
            return []
        self._seen.add(here)
        try:
            with os.scandir(here) as entries:
                inside = {entry.name: entry.is_dir(follow_symlinks=True) for entry in entries}
        except OSError:
            return []
        if here != place and not _IGNORED.isdisjoint(inside):
            return []
        is_package = not inside.keys().isdisjoint(_MANIFESTS)
        if is_package:
            self.stated.setdefault(_stated_name(here), here)
            self.bearing.setdefault(here.name, here)
        elif here in self._given or here.parent in self._given:
            self.stated.setdefault(here.name, here)
        if "ament_index" in inside and (here / _INDEX).is_dir():
            for name in os.listdir(here / _INDEX):
                if inside.get(name):
                    self.stated.setdefault(name, here / name)
        if is_package and here != place:
            return []
        folders = sorted(name for name, is_folder in inside.items() if is_folder)
        return [here / n for n in folders if not n.startswith(".") and n not in _SKIPPED]


def _stated_name(package: Path) -> str:
    try:
        text = (package / "package.xml").read_text(encoding="utf-8", errors="replace")
    except OSError:
        text = ""
    stated = _NAME.search(_COMMENT.sub("", text))
    return stated[1] if stated else package.name


_CMAKE_COMMENT = re.compile(r"#[^\n]*")
_PROJECT = re.compile(r"\bproject\s*\(\s*\"?([^\s\")]+)", re.IGNORECASE)
_INSTALL = re.compile(r"\binstall\s*\(([^()]*)\)", re.IGNORECASE)
_WORD = re.compile(r'"([^"]*)"|(\S+)')
_SOURCES = ("DIRECTORY", "FILES", "PROGRAMS")
_SHARE = ("share/{}", "${{CATKIN_PACKAGE_SHARE_DESTINATION}}", "${{CMAKE_INSTALL_DATADIR}}/{}",
          "${{CMAKE_INSTALL_DATAROOTDIR}}/{}")  # fmt: skip


def find_installed(package: Path, inner: str) -> Path | None:
    """Return the source file or folder that is installed as ``inner`` of a package."""
    for place, source in _read_rules(package):
        if place == "." or inner == place or inner.startswith(f"{place}/"):
            rest = inner if place == "." else inner[len(place) :].lstrip("/")
            path = package / source / rest if rest else package / source
            if path.exists():
                return path
    return None


def locate(path: Path, packages: Iterable[Path]) -> Path | None:
    """Return an existing path, or the source from which a package installs it."""
    if path.exists():
        return path
    for package in packages:
        if path.is_relative_to(package):
            installed = find_installed(package, str(path.relative_to(package)))
            if installed is not None:
                return installed
    return None


def find_in_any_case(path: Path) -> Path | None:
    """Return the only existing path that differs at most in upper and lower case, or None."""
    here = Path(path.anchor)
    for part in path.parts[1:]:
        if not (here / part).exists():
            try:
                names = [name for name in os.listdir(here) if name.lower() == part.lower()]
            except OSError:
                return None
            if len(names) != 1:
                return None
            part = names[0]
        here /= part
    return here


@lru_cache(maxsize=1024)
def _read_rules(package: Path) -> tuple[tuple[str, str], ...]:
    try:
        text = (package / "CMakeLists.txt").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ()
    text = _CMAKE_COMMENT.sub("", text)
    project = _PROJECT.search(text)
    name = project[1] if project else package.name
    return tuple(
        rule
        for arguments in _INSTALL.findall(text)
        for rule in _read_rule(arguments.replace("${PROJECT_NAME}", name), name)
    )


def _read_rule(arguments: str, name: str) -> Iterator[tuple[str, str]]:
    words = [quoted or plain for quoted, plain in _WORD.findall(arguments)]
    if not words or words[0] not in _SOURCES or "DESTINATION" not in words[:-1]:
        return
    destination = words[words.index("DESTINATION") + 1].rstrip("/")
    share = next(filter(destination.startswith, (text.format(name) for text in _SHARE)), None)
    if share is None or destination[len(share) :][:1] not in ("", "/"):
        return
    folder = PurePosixPath(destination[len(share) :].lstrip("/"))
    for source in words[1 : words.index("DESTINATION")]:
        if source.isupper():  # keyword, such as PATTERN
            return
        contents = words[0] == "DIRECTORY" and source.endswith("/")
        yield str(folder if contents else folder / PurePosixPath(source).name), source
