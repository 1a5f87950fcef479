"""Reads the run, or the runs of a sweep, whose configuration an evaluation takes over."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.config.configuration import Configuration
from evoros.config.like import LIKE, RecordedRun, is_below
from evoros.config.own_files import NAMED_FOLDERS
from evoros.config.recorded import flatten_recorded, read_recorded
from evoros.config.targets import check_targets
from evoros.evolution.experiment import Experiment
from evoros.files.resources import expand_home
from evoros.observers.protocol import FREE
from evoros.session.given_designs import require_finished
from evoros.storage.discovery import folders_below
from evoros.storage.layout import (
    CONFIG,
    FINISHED,
    FORMAT_VERSION,
    MANIFEST,
    RUN,
    STATUS,
    command_of,
    read_json,
)
from evoros.storage.manifest import find_changes
from evoros.storage.originals import read_original
from evoros.terminal.log import LOGGER, warn_left_out

UNUSED = (*(*FREE, "figures", "treatment", "objectives", "descriptors", "draws", "final_choice"),)
"""Keys that an evaluation does not use."""
OF_VALIDATION = ("optimizer", "allocation", "confirmation", "validation")
"""Keys that it uses only if its designs meet the draws of a validation."""


def read_like(source: str, typed: frozenset[str]) -> RecordedRun:
    """Read the recorded configuration of a finished run, or of a sweep whose runs agree.

    ``typed`` are the places of typed values, in which the runs may differ.

    Raises:
        InputError: there is no finished run, one is damaged or of another version, or two differ.
    """
    first, *others = _list_runs(source)
    ignored = {*UNUSED, *typed, *(() if "evaluation_draws" in typed else OF_VALIDATION)}
    values = flatten_recorded(first / CONFIG)
    for folder in others:
        now = flatten_recorded(folder / CONFIG)
        _require_agreement(source, (first, values), (folder, now), ignored)
    check_targets(read_recorded(first / CONFIG).values, NAMED_FOLDERS, first / CONFIG)
    manifest = read_json(first / MANIFEST)
    text = read_original(first, CONFIG, manifest).decode()
    return RecordedRun(text, manifest.get("choices", {}))


def warn_of_changes(config: Configuration, experiment: Experiment) -> None:
    """Warn of each robot, world and module that is not as in the run whose configuration is used.

    The file may have changed, or its path may be relative to another folder.
    """
    if config.like is None:
        return
    folder = next(iter(_list_runs(config.like)))
    manifest = read_json(folder / MANIFEST)
    typed = {override.lstrip("+~").partition("=")[0] for override in config.overrides}
    for name in find_changes(manifest, experiment, config.text, config.values, {}):
        kind = name.partition(" ")[0]
        changed_by_hand = any(is_below(kind, [key]) or is_below(key, [kind]) for key in typed)
        if kind not in ("configuration", "simulators") and not changed_by_hand:
            LOGGER.warning(
                "like=%s: %s is not as it was in the run: its file has changed, or its path is "
                "relative to %s; restore it, or start evoros there",
                *(folder, name, manifest.get("working_directory")),
            )


def _list_runs(source: str) -> list[Path]:
    """List the finished runs in a folder, which may be a run itself."""
    path = expand_home(source)
    folders = list(folders_below(path, warn_left_out))
    if folders in ([], [path]):
        runs = [path]
    else:  # those that are left out are named when their champions are read
        runs = [folder for folder in folders if command_of(folder) == RUN]
        finished = [run for run in runs if read_json(run / STATUS).get("state") == FINISHED]
        runs = finished or runs[:1] or [path]
    for run in runs:
        require_finished(run, LIKE)
        version = read_json(run / MANIFEST).get("format_version")
        if version != FORMAT_VERSION:
            raise InputError(
                f"like={run}: format_version must be {FORMAT_VERSION}, not {version!r}; use the "
                f"version of evoros that made it"
            )
    return runs


def _require_agreement(
    source: str,
    one: tuple[Path, Mapping[str, Any]],
    other: tuple[Path, Mapping[str, Any]],
    ignored: Iterable[str],
) -> None:
    (first, before), (folder, now) = one, other
    for key in dict.fromkeys((*before, *now)):
        if before.get(key) != now.get(key) and not is_below(key, ignored):
            raise InputError(
                f"like={source}: its runs must agree in {key}, and it is {before.get(key)!r} in "
                f"{first.name} and {now.get(key)!r} in {folder.name}; type {key}=..., or "
                f"like={folder} designs={source}"
            )
