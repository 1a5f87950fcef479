"""Finds the folders of runs and evaluations, and gives them short names."""

import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from evoros.errors import InputError
from evoros.log import LOGGER

MARKS = ("config.yaml", "manifest.json", "missions.csv")
"""A folder with one of these is, or should be, that of a run or an evaluation."""


def folders_in(path: Path) -> Iterator[Path]:
    """The folders of runs and evaluations in ``path``, or itself; nothing is looked for in them."""
    if not path.is_dir():
        raise InputError(f"{path}: must be a folder of runs, and there is none; correct the path")
    begun = False
    for top, below, files in os.walk(path):
        below[:] = sorted((name for name in below if not name.startswith(".")), key=_natural)
        if any(name in files for name in MARKS):
            begun = True
            below.clear()
            yield Path(top)
    if not begun:
        LOGGER.warning("%s: must hold runs, and holds none; left out", path)


def _natural(name: str) -> list[tuple[int, str]]:
    """For sorting: ``seed-10`` comes after ``seed-9``."""
    return [
        (int(part or -1), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)
    ]


def short_names(folders: Iterable[Path]) -> dict[Path, str]:
    """For each folder as much of the end of its path as tells it from the others."""
    rest, names = {folder: folder.resolve().parts for folder in folders}, dict[Path, str]()
    length = 1
    while rest:
        ends = {folder: parts[-length:] for folder, parts in rest.items()}
        taken = list(ends.values())
        for folder, end in ends.items():
            if taken.count(end) == 1 or length >= len(rest[folder]):
                names[folder] = "/".join(end)
        rest = {folder: parts for folder, parts in rest.items() if folder not in names}
        length += 1
    return names
