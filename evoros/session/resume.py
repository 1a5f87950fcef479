"""Rebuilds the experiment of a folder to resume work in it."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import chdir, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from evoros.base.errors import InputError
from evoros.config.compose import add_config_dir
from evoros.config.configuration import Configuration
from evoros.config.own_files import NAMED_FOLDERS
from evoros.config.recorded import override_recorded, read_recorded
from evoros.config.targets import check_targets
from evoros.evolution.experiment import Experiment
from evoros.files.disk import require_no_links
from evoros.storage.creation import require_whole
from evoros.storage.discovery import folders_below
from evoros.storage.file_reading import read_sealed
from evoros.storage.layout import (
    CONFIG,
    CONFIG_DIR,
    EVALUATE,
    LOG,
    MANIFEST,
    ORIGINALS,
    OVERRIDES,
    RUN,
    command_of,
    resume_command,
)
from evoros.storage.manifest import check_unchanged, find_changes, list_other_versions
from evoros.storage.originals import read_original
from evoros.storage.relocation import NOWHERE, Relocation
from evoros.terminal.log import LOGGER
from evoros.terminal.repetition import read_again

ORIGINALS_OF = {RUN: (CONFIG,), EVALUATE: ORIGINALS}
"""The files from which everything else in the folder of a command follows."""


class Rebuilt(NamedTuple):
    """The experiment of a folder, built again."""

    experiment: Experiment
    generations: int | None
    """The generations that the overrides ask for; None if they do not."""
    config: Configuration
    """The recorded configuration with the overrides."""


def rebuild(
    folder: Path,
    overrides: Sequence[str],
    config_dir: str | Path | None,
    command: str = RUN,
    *,
    warns: bool = True,
    places: Relocation = NOWHERE,
) -> Rebuilt:
    """Build the experiment of a folder again, with the overrides that resuming allows.

    ``command`` must have made the folder. ``warns`` tells whether other versions of packages are
    reported. ``places`` has the folders whose paths the record of an archive does not have.

    Raises:
        InputError: the folder was not made by that command, another override, or something that
            the run is made of has changed.
    """
    if config_dir is not None:
        add_config_dir(config_dir)
    manifest = _read_manifest(folder, command)
    names = ORIGINALS_OF[command]
    contents = {name: read_original(folder, name, manifest).decode() for name in names}
    recorded = read_recorded(folder / CONFIG)
    config, generations = override_recorded(recorded, overrides, config_dir, command == RUN)
    check_targets(config.values, NAMED_FOLDERS, folder / CONFIG)
    with change_to_origin(manifest), read_again(folder.absolute() / LOG):
        experiment = config.build()
    contents.pop(CONFIG)
    texts = recorded.text, recorded.values, contents
    check_unchanged(folder, manifest, find_changes(manifest, experiment, *texts, places))
    if warns:
        for name, before, now in list_other_versions(manifest, experiment, recorded.values):
            LOGGER.warning(
                "%s: made with %s %s, and this is %s; new missions may differ from those on disk",
                *(folder, name, before, now),
            )
    typed = manifest.get(OVERRIDES, ())
    choices, own = manifest.get("choices", {}), manifest.get(CONFIG_DIR)
    config = replace(config, choices=choices, overrides=typed, config_dir=own)
    return Rebuilt(experiment, generations, config)


@contextmanager
def change_to_origin(manifest: Mapping[str, Any]) -> Iterator[None]:
    """Change to the folder where the run was started: paths may be relative to it."""
    origin = Path(str(manifest.get("working_directory", ".")))
    with chdir(origin if origin.is_dir() else Path.cwd()):
        yield


def _read_manifest(folder: Path, command: str) -> Mapping[str, Any]:
    if folder.is_dir():
        require_no_links(folder)
    require_whole(folder)
    if not (folder / CONFIG).is_file() or not (folder / MANIFEST).is_file():
        swept = any(folders_below(folder, lambda _: None))
        fix = "type the command of its sweep again, which goes on with what is not finished"
        raise InputError(
            f"{folder}: must be the folder of a run, with {CONFIG} and {MANIFEST}; "
            f"{fix if swept else 'give such a folder'}"
        )
    manifest = read_sealed(folder, MANIFEST)
    if command_of(folder) != command:
        raise InputError(
            f"{folder}: must be a folder that {command} made, and {command_of(folder)} made it; "
            f"type: {resume_command(folder)}"
        )
    return manifest
