"""Where the runs of a study lie in an archive, and what evaluations call them there."""

import csv
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.session.reproduction import list_finished
from evoros.storage.archives import RUNS
from evoros.storage.layout import DESIGN_FILE, OVERRIDES, SWEEP

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


def place_named(folder: Path, manifest: Mapping[str, Any], tops: Sequence[Path]) -> dict[str, str]:
    """Place the folders that a run or an evaluation may name, by their full paths.

    These are ``tops``, all folders to archive, its sweep, and the sources of an evaluation's
    designs. Those outside of ``tops`` are called by their names.
    """
    places = {str(path): place_inside(top, top) for top in tops for path in _list_names(top)}
    for path in map(Path, filter(os.path.isabs, _list_sources(folder, manifest))):
        inside = (top for top in tops if path.resolve().is_relative_to(top.resolve()))
        top = next(inside, None)
        places[str(path)] = path.name if top is None else place_inside(top, path)
    return {path: place for path, place in places.items() if path != "/"}


def _list_names(folder: Path) -> tuple[Path, Path]:
    return folder.absolute(), folder.resolve()


def _list_sources(folder: Path, manifest: Mapping[str, Any]) -> Iterator[str]:
    """Yield the sweep of a run, and the sources of an evaluation's designs, as recorded."""
    yield manifest.get(SWEEP) or ""
    if not (folder / DESIGN_FILE).is_file():
        return
    typed = (text for text in manifest.get(OVERRIDES, ()) if text.startswith("designs="))
    yield from (name for text in typed for name in _BETWEEN.split(text))
    with (folder / DESIGN_FILE).open(newline="", encoding="utf-8") as file:
        yield from (row["source"] for row in csv.DictReader(file))
