"""Finds the folders of runs and evaluations below a folder, for example a sweep's."""

import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path

from evoros.files.disk import explain_rights

MARKS = ("config.yaml", "manifest.json", "missions.csv")
"""A folder with one of these files is the folder of a run or an evaluation, maybe a damaged one."""


def folders_below(path: Path, skip: Callable[[str], object]) -> Iterator[Path]:
    """Yield the folders of runs and evaluations below ``path``, or ``path`` if it is one.

    They come in the order of their names, with numbers in the order of their values: ``seed-10``
    after ``seed-9``. The search does not enter them. ``skip`` receives the reason why one cannot
    be read.
    """

    def explain(error: OSError) -> None:
        if explanation := explain_rights(error):
            skip(explanation)

    for parent, folders, files in os.walk(path, onerror=explain):
        folders[:] = sorted((f for f in folders if not f.startswith(".")), key=natural_key)
        if any(name in files for name in MARKS):
            folders.clear()
            yield Path(parent)


def natural_key(name: str) -> list[tuple[int, str]]:
    """A key that sorts names with numbers in the order of their values."""
    return [
        (int(part or -1), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)
    ]
