"""Where the runs of a study lie in an archive, and what evaluations call them there."""

import csv
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.session.reproduction import list_finished
from evoros.storage.archives import RUNS
from evoros.storage.layout import DESIGN_FILE, OVERRIDES

_BETWEEN = re.compile(r"[=\[\],'\"]")


def list_places(folders: Sequence[Path]) -> dict[Path, str]:
    """Return the folders of all runs, each with its place in the archive.

    Raises:
        InputError: a folder has no finished run, or two runs would have the same place.
    """
    places: dict[Path, str] = {}
    for top in folders:
        for folder in list_finished(top, "archived"):
            place = place_inside(top, folder)
            if place in places.values():
                raise InputError(
                    f"{folder}: must have another name than the other folders, and {place} is "
                    f"there already; rename it, or archive the folder above them"
                )
            places[folder] = place
    return places


def place_inside(top: Path, path: Path) -> str:
    """Return the place of a folder in ``top``, which may be ``top`` itself."""
    inner = path.resolve().relative_to(top.resolve()).as_posix()
    place = f"{RUNS}/{top.resolve().name}"
    return place if inner == "." else f"{place}/{inner}"


def place_evaluated(
    folder: Path, manifest: Mapping[str, Any], tops: Sequence[Path]
) -> dict[str, str]:
    """Place the sources of designs that an evaluation names by full paths; a run names none.

    They are called by their places if they are archived, too, and otherwise by their names.
    """
    places: dict[str, str] = {}
    for path in _list_evaluated(folder, manifest):
        inside = (top for top in tops if path.resolve().is_relative_to(top.resolve()))
        top = next(inside, None)
        places[str(path)] = path.name if top is None else place_inside(top, path)
    return places


def _list_evaluated(folder: Path, manifest: Mapping[str, Any]) -> set[Path]:
    if not (folder / DESIGN_FILE).is_file():
        return set()
    typed = (text for text in manifest.get(OVERRIDES, ()) if text.startswith("designs="))
    names = [name for text in typed for name in _BETWEEN.split(text)]
    with (folder / DESIGN_FILE).open(newline="", encoding="utf-8") as file:
        names += [row["source"] for row in csv.DictReader(file)]
    return {Path(name) for name in names if os.path.isabs(name)}
