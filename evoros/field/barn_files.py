"""The public worlds of BARN, as their repository has them: one for each trial."""

import hashlib
import math
import re
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np

from evoros.base.checks import sequence_of
from evoros.base.errors import InputError
from evoros.field.barn import read_grid
from evoros.field.barn_grid import CELL_M, find_free, find_shortest, measure_way
from evoros.files.resources import expand_home, read_file
from evoros.terminal.log import withhold_messages
from evoros.world.course import A_COURSE, Course
from evoros.world.loading import load_world
from evoros.world.model import KEPT_WORLDS, World

PATHS = "path_files"
PATH_ORIGIN_M = (-4.575, 5.075)
"""The place of the cell (0, 0) of a path file: the challenge's run.py takes it for its lengths."""


@dataclass(frozen=True)
class BarnFiles:
    """The files of a folder, in the order of their numbers: trial N drives in file N."""

    files: Annotated[tuple[str, ...], sequence_of(str, "paths")]
    course: Annotated[Course, A_COURSE]

    def draw_world(self, draws: str) -> World:
        """Load the world of the trial, the last part of ``draws``; file 0 if it has none."""
        trial = draws.rpartition("/")[2]
        number = int(trial) if trial.isdecimal() else 0
        return _load_file(self.files[number % len(self.files)], self.course)


def load_barn(folder: str, course: Course) -> World:
    """Load the worlds ``world_N.world`` of a folder: trial N drives in world N.

    The shortest way is that of ``path_files/path_N.npy``, measured as the challenge does; without
    this file it is computed as for drawn worlds.

    Raises:
        InputError: the folder has no such file, or a file cannot be used.
    """
    place = expand_home(folder)
    found = {int(path.stem.removeprefix("world_")): path for path in _list_worlds(place)}
    if not found:
        raise InputError(
            f"{folder}: must be a folder with files world_N.world, but has none; clone "
            f"https://github.com/Daffan/the-barn-challenge, and name its jackal_helper/worlds/BARN"
        )
    files = tuple(str(found[number].resolve()) for number in sorted(found))
    digest = hashlib.sha256()
    for file in files:
        digest.update(read_file(Path(file)))
        path = _name_path(Path(file))
        digest.update(read_file(path) if path.is_file() else b"")
    sampler = BarnFiles(files, course)
    return replace(sampler.draw_world(""), sampler=sampler, source_sha256=digest.hexdigest())


def _list_worlds(folder: Path) -> list[Path]:
    return [path for path in folder.glob("world_*.world") if re.fullmatch(r"world_\d+", path.stem)]


def _name_path(world: Path) -> Path:
    return world.parent / PATHS / f"{world.stem.replace('world', 'path')}.npy"


@lru_cache(maxsize=KEPT_WORLDS)
def _load_file(file: str, course: Course) -> World:
    with withhold_messages():
        world = load_world(file, course)
    path = _name_path(Path(file))
    shortest = measure_path(path, course) if path.is_file() else _plan(world)
    if not shortest:
        raise InputError(f"{file}: must have a way across its grid, but has none; remove it")
    return replace(world, name="barn_files", shortest_m=shortest)


def _plan(world: World) -> float:
    (x, y), home = world.course.waypoints[-1], world.course.home[:2]
    return measure_way(find_shortest(find_free(read_grid(world.obstacles)), home, (x, y)))


def measure_path(path: Path, course: Course) -> float:
    """Return the length [m] of the way by a path file, from home to the last waypoint."""
    try:
        cells = np.load(path, allow_pickle=False)
        points = np.asarray(cells, dtype=np.float64).reshape(-1, 2) * CELL_M + PATH_ORIGIN_M
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"{path}: must be an array of cells, but: {error}; remove it") from None
    way = [course.home[:2], *points.tolist(), course.waypoints[-1]]
    return math.fsum(math.dist(a, b) for a, b in pairwise(way))
