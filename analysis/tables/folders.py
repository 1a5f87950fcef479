"""Find the folders of runs and evaluations, and shorten their names."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from evoros.base.errors import InputError
from evoros.storage.discovery import folders_below
from evoros.terminal.log import LOGGER, warn_left_out


def find_folders(paths: Sequence[Path]) -> list[Path]:
    """Find the run and evaluation folders below paths, each once: none is two replicates."""
    folders: dict[Path, Path] = {}
    for path in paths:
        for folder in list_folders(path):
            folders.setdefault(folder.resolve(), folder)
    return list(folders.values())


def list_folders(path: Path) -> Iterator[Path]:
    """Yield ``path`` itself or the run and evaluation folders below it; warn if there are none."""
    if not path.is_dir():
        raise InputError(f"{path}: must be a folder of runs, but does not exist; correct the path")
    folders = list(folders_below(path, warn_left_out))
    if not folders:
        LOGGER.warning("%s: must contain runs, but contains none; left out", path)
    yield from folders


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
