"""The files from which runs follow: the user's own parts, robots, worlds and meshes."""

import os
import re
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

from evoros.base.errors import InputError
from evoros.evolution.experiment import Experiment
from evoros.files.private import cache_home
from evoros.files.resources import PACKAGE, bundled_folder
from evoros.storage.archives import is_run

_SYSTEM = ("/bin", "/dev", "/etc", "/lib", "/lib64", "/proc", "/run", "/sys", "/usr")
_COMPILED = ("__pycache__", ".git")
_ADDRESS = re.compile(r"filename=\"file://([^\"]+)\"")
_DESCRIBING = ("package.xml", "CMakeLists.txt")
"""Files of a ROS package, which are read of all packages around."""


def list_parts(folder: Path) -> Iterator[Path]:
    """Yield the files in a folder of parts, but for hidden and compiled ones, and results."""
    for parent, folders, files in os.walk(folder):
        kept = [name for name in folders if not name.startswith(".") and name not in _COMPILED]
        folders[:] = sorted(name for name in kept if not is_run(Path(parent, name)))
        own = (name for name in files if not name.startswith(".") and not name.endswith(".zip"))
        yield from (Path(parent, name) for name in sorted(own))


def list_read(reads: Iterable[Path], experiment: Experiment, folder: Path) -> set[Path]:
    """Return what was read of the user's files while the run in a folder was built."""
    robots = [experiment.robot, *(agent.robot for agent in experiment.agents.values())]
    meshes = (_ADDRESS.findall(robot.urdf) for robot in robots if robot is not None)
    paths = {*reads, *(Path(name) for names in meshes for name in names)}
    others = [PACKAGE, *map(bundled_folder, ("conf", "robots", "worlds")), folder.resolve()]
    others += map(Path, (*_SYSTEM, sys.prefix, sys.base_prefix, cache_home()))
    own = {path for path in paths if path.is_file() and not _is_in(path, others)}
    own = {path for path in own if not {*_COMPILED} & {*path.parts}}
    described = {path.parent for path in own if path.name not in _DESCRIBING}
    return {
        path
        for path in own
        if path.name not in _DESCRIBING
        or any(path.parent in one.parents for one in described)
        or path.parent in described
    }


def find_top(file: Path) -> Path:
    """Return the folder with which a file is moved: its ROS package, or the folder it lies in."""
    return next((p for p in file.parents if (p / _DESCRIBING[0]).is_file()), file.parent)


def read_input(path: Path) -> bytes:
    """Read a file of the user's."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(
            f"{path}: must be readable to be archived ({error.strerror}); change its permissions, "
            f"or move it elsewhere"
        ) from error


def _is_in(path: Path, folders: Iterable[Path]) -> bool:
    return any(path.is_relative_to(folder) for folder in folders)
