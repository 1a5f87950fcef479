"""Finds the folders of runs and evaluations below a folder, as a sweep leaves them."""

import os
import re
from collections.abc import Iterator
from pathlib import Path

MARKS = ("config.yaml", "manifest.json", "missions.csv")
"""A folder with one of these is, or should be, that of a run or an evaluation."""


def folders_below(path: Path) -> Iterator[Path]:
    """The folders of runs and evaluations in ``path``, or itself; nothing is looked for in them.

    In the order of their names, numbers by their value: ``seed-10`` comes after ``seed-9``.
    """
    for top, below, files in os.walk(path):
        below[:] = sorted((name for name in below if not name.startswith(".")), key=_natural)
        if any(name in files for name in MARKS):
            below.clear()
            yield Path(top)


def _natural(name: str) -> list[tuple[int, str]]:
    return [
        (int(part or -1), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)
    ]
