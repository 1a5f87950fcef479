"""Finds the folders of runs and evaluations, and gives them short names."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from evoros.base.errors import InputError
from evoros.base.log import LOGGER
from evoros.storage.discovery import folders_below


def folders_of(paths: Sequence[Path]) -> list[Path]:
    """The folders of runs and evaluations in all of these, each once, whatever ways lead to it.

    One that counted twice would be taken for two replicates.

    Raises:
        InputError: a path leads nowhere.
    """
    found: dict[Path, Path] = {}
    for path in paths:
        for folder in folders_in(path):
            found.setdefault(folder.resolve(), folder)
    return list(found.values())


def folders_in(path: Path) -> Iterator[Path]:
    """The folders of runs and evaluations in ``path``, or itself; that there is none is said.

    Raises:
        InputError: there is no such folder.
    """
    if not path.is_dir():
        raise InputError(f"{path}: must be a folder of runs, and there is none; correct the path")
    found = list(folders_below(path))
    if not found:
        LOGGER.warning("%s: must hold runs, and holds none; left out", path)
    yield from found


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
