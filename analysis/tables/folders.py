"""Find the folders of runs and evaluations, and shorten their names."""

import shlex
from collections.abc import Iterable, Sequence
from itertools import product
from pathlib import Path

from evoros.base.errors import InputError
from evoros.storage.discovery import folders_below
from evoros.terminal.log import LOGGER, warn_left_out

MOST_SPACES = 3
"""Maximum number of spaces in a path that a missing quote has split and that is found again."""


def find_folders(paths: Sequence[Path]) -> list[Path]:
    """Find the run and evaluation folders below paths, each once: none is two replicates."""
    folders: dict[Path, Path] = {}
    for i, path in enumerate(paths):
        if not path.is_dir():
            raise InputError(
                f"{path}: must be a folder of runs, but does not exist; {_advise(paths, i)}"
            )
        below = list(folders_below(path, warn_left_out))
        if not below:
            LOGGER.warning("%s: must contain runs, but contains none; left out", path)
        for folder in below:
            folders.setdefault(folder.resolve(), folder)
    return list(folders.values())


def _advise(paths: Sequence[Path], missing: int) -> str:
    """Advise how to correct a path that may be a part of one with a space."""
    starts, ends = range(max(0, missing - MOST_SPACES), missing + 1), range(1, MOST_SPACES + 2)
    for start, length in product(starts, ends):
        whole = Path(" ".join(map(str, paths[start : start + length])))
        if whole.is_dir() and start <= missing < start + length:
            return f"a path with a space needs quotes: {shlex.quote(str(whole))}"
    return "correct the path"


def shorten_names(folders: Iterable[Path]) -> dict[Path, str]:
    """Name each folder by the shortest end of its path that no other folder has."""
    unnamed, names = {folder: folder.resolve().parts for folder in folders}, dict[Path, str]()
    length = 1
    while unnamed:
        ends = {folder: parts[-length:] for folder, parts in unnamed.items()}
        taken = list(ends.values())
        for folder, end in ends.items():
            if taken.count(end) == 1 or length >= len(unnamed[folder]):
                names[folder] = "/".join(end)
        unnamed = {folder: parts for folder, parts in unnamed.items() if folder not in names}
        length += 1
    return names
