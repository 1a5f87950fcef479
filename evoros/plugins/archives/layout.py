"""The paths of runs and their input files in an archive."""

import csv
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError, escape
from evoros.evolution.experiment import Experiment
from evoros.files.private import cache_home
from evoros.files.resources import PACKAGE, bundled_folder
from evoros.session.reproduction import list_finished
from evoros.storage.archives import INPUTS, RUNS, Relocation, is_run
from evoros.storage.layout import DESIGN_FILE, OVERRIDES, SWEEP

_SYSTEM = ("/bin", "/dev", "/etc", "/lib", "/lib64", "/proc", "/run", "/sys", "/usr")
_COMPILED = ("__pycache__", ".git")
_ADDRESS = re.compile(r"filename=\"file://([^\"]+)\"")
_DESCRIBING = ("package.xml", "CMakeLists.txt")  # ROS tools read these files of every package
_BETWEEN = re.compile(r"[=\[\],'\"]")


@dataclass(frozen=True)
class Layout:
    """Maps full folder paths to archive paths."""

    places: Mapping[Path, str]

    @classmethod
    def around(cls, folders: Iterable[Path], home: Path | None) -> "Layout":
        """Assign archive paths that keep relative paths valid, and leave out the user's name."""
        given = dict.fromkeys(folders)
        tops = [one for one in given if not any(other in one.parents for other in given)]
        if not tops:
            return cls({})
        base = Path(os.path.commonpath(tops))
        if len(base.parts) > 1 and (home is None or base not in home.parents):
            return cls({path: _join(INPUTS, path.relative_to(base)) for path in (base, *given)})
        places: dict[Path, str] = {}
        for top in tops:
            names = {place.casefold() for place in places.values()}
            place = f"{INPUTS}/{top.name}"
            while place.casefold() in names:
                place += "_"
            places[top] = place
        for path in given:
            top = next(top for top in tops if path.is_relative_to(top))
            places[path] = _join(places[top], path.relative_to(top))
        return cls(places)

    def place(self, path: Path) -> str:
        """Return the archive path of a file or folder inside a mapped folder."""
        above = next(folder for folder in (path, *path.parents) if folder in self.places)
        place = _join(self.places[above], path.relative_to(above))
        if escape(place) != place:
            raise InputError(
                f"{path}: cannot be archived, because the name is not UTF-8; rename the file"
            )
        return place

    def holds(self, path: Path) -> bool:
        """Return True if a file is inside a mapped folder."""
        return any(folder in self.places for folder in path.parents)

    def relocation(self, working: str, others: Mapping[str, str]) -> Relocation:
        """Return ``others`` plus the mapped folders' paths relative to the archive's folder."""
        named = {str(path): place for path, place in self.places.items() if len(path.parts) > 1}
        inside = {path: os.path.relpath(place, working) for path, place in named.items()}
        return Relocation({**others, **inside})


def _join(place: str, rest: Path) -> str:
    return place if rest == Path() else f"{place}/{rest.as_posix()}"


def list_places(folders: Sequence[Path]) -> dict[Path, str]:
    """Return the archive path of each run folder."""
    places: dict[Path, str] = {}
    for top in folders:
        for folder in list_finished(top, "archived"):
            place = place_inside(top, folder)
            if place in places.values():
                raise InputError(
                    f"{folder}: another folder has the same archive path {place}; rename one of "
                    f"the two, or archive the folder that contains both"
                )
            places[folder] = place
    return places


def place_inside(top: Path, path: Path) -> str:
    """Return the archive path of ``top`` or a folder inside it."""
    name = escape(top.resolve().name).replace("\\", "_")  # archive paths cannot contain backslashes
    return _join(f"{RUNS}/{name}", path.resolve().relative_to(top.resolve()))


def place_named(folder: Path, manifest: Mapping[str, Any], tops: Sequence[Path]) -> dict[str, str]:
    """Map each folder that may appear in the files of a run or evaluation to its archive path.

    These are ``tops``, the sweep, and sources of designs; others keep only their name.
    """
    both = ((top, path) for top in tops for path in (top.absolute(), top.resolve()))
    places = {str(path): place_inside(top, top) for top, path in both}
    for path in map(Path, filter(os.path.isabs, _list_sources(folder, manifest))):
        inside = (top for top in tops if path.resolve().is_relative_to(top.resolve()))
        top = next(inside, None)
        places[str(path)] = path.name if top is None else place_inside(top, path)
    return {path: place for path, place in places.items() if path != "/"}


def _list_sources(folder: Path, manifest: Mapping[str, Any]) -> Iterator[str]:
    yield manifest.get(SWEEP) or ""
    if not (folder / DESIGN_FILE).is_file():
        return
    typed = (text for text in manifest.get(OVERRIDES, ()) if text.startswith("designs="))
    yield from (name for text in typed for name in _BETWEEN.split(text))
    with (folder / DESIGN_FILE).open(newline="", encoding="utf-8") as file:
        yield from (row["source"] for row in csv.DictReader(file))


def list_parts(folder: Path) -> Iterator[Path]:
    """Yield the files in a folder of parts, except hidden files, compiled files and results."""
    for parent, folders, files in os.walk(folder):
        kept = [name for name in folders if not name.startswith(".") and name not in _COMPILED]
        folders[:] = sorted(name for name in kept if not is_run(Path(parent, name)))
        own = (name for name in files if not name.startswith(".") and not name.endswith(".zip"))
        yield from (Path(parent, name) for name in sorted(own))


def list_read(reads: Iterable[Path], experiment: Experiment, folder: Path) -> set[Path]:
    """Return the user's files that were read while the run in ``folder`` was built."""
    robots = [experiment.robot, *(agent.robot for agent in experiment.agents.values())]
    meshes = (_ADDRESS.findall(robot.urdf) for robot in robots if robot is not None)
    paths = {*reads, *(Path(name) for names in meshes for name in names)}
    others = [PACKAGE, *map(bundled_folder, ("conf", "robots", "worlds")), folder.resolve()]
    others += [*map(Path, (*_SYSTEM, sys.prefix, sys.base_prefix)), cache_home()]
    own = {path for path in paths if path.is_file() and not {*_COMPILED} & {*path.parts}}
    own = {path for path in own if not any(path.is_relative_to(folder) for folder in others)}
    described = {path.parent for path in own if path.name not in _DESCRIBING}
    return {
        path
        for path in own
        if path.name not in _DESCRIBING
        or any(path.parent in one.parents for one in described)
        or path.parent in described
    }


def find_top(file: Path) -> Path:
    """Return the folder to archive with a file: its ROS package, or the folder that contains it."""
    return next((p for p in file.parents if (p / _DESCRIBING[0]).is_file()), file.parent)


def read_input(path: Path) -> bytes:
    """Read one of the user's files."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read to be archived ({error.strerror}); change the file's "
            f"permissions, or move the file elsewhere"
        ) from error
