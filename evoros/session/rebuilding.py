"""Rebuilds the experiment of a recorded run, and plans its recorded missions."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import chdir, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from evoros.base.errors import InputError
from evoros.config.compose import add_config_dir
from evoros.config.configuration import Configuration, check_targets
from evoros.config.own_files import NAMED_FOLDERS
from evoros.config.recorded import override_recorded, read_recorded
from evoros.design.design import Design
from evoros.evolution.experiment import STATED, Experiment
from evoros.failure.protocol import Case
from evoros.files.disk import require_no_links
from evoros.mission.mission import Mission, MissionKey
from evoros.mission.plan import GENERATIONS, MOST_REPEATS, find_growing
from evoros.mission.scenario import Scenario
from evoros.storage import layout
from evoros.storage.archives import NOWHERE, Relocation
from evoros.storage.creation import require_whole
from evoros.storage.digests import read_original
from evoros.storage.layout import read_sealed
from evoros.storage.manifest import (
    check_unchanged,
    find_changes,
    list_other_versions,
    list_unrecorded,
)
from evoros.storage.tables import CASE
from evoros.terminal.log import LOGGER, read_again


class Rebuilt(NamedTuple):
    """The experiment of a recorded run."""

    experiment: Experiment
    number: int | None  # number of generations or trials set by the overrides; None if not set
    config: Configuration  # the recorded configuration, with overrides applied


def rebuild(
    folder: Path,
    overrides: Sequence[str] = (),
    config_dir: str | Path | None = None,
    *,
    warns: bool = True,
    places: Relocation = NOWHERE,
    mends: bool = False,
) -> Rebuilt:
    """Rebuild the experiment of a run, with overrides that resuming allows.

    This executes the code that the configuration names. ``warns`` enables warnings about changed
    package versions. ``places`` maps recorded folders to those in an unpacked archive. ``mends``
    accepts parts that have changed but affected no recorded result.
    """
    if config_dir is not None:
        add_config_dir(config_dir)
    manifest = _read_manifest(folder)
    given = layout.evaluates(folder)
    names = layout.ORIGINALS if given else (layout.CONFIG,)
    contents = {name: read_original(folder, name, manifest).decode() for name in names}
    recorded = read_recorded(folder / layout.CONFIG)
    growing = find_growing(recorded.values) if given else GENERATIONS
    config, number = override_recorded(recorded, overrides, config_dir, growing)
    check_targets(config.values, NAMED_FOLDERS, folder / layout.CONFIG)
    with change_to_origin(manifest), read_again(folder.absolute() / layout.LOG):
        experiment = config.build()
    contents.pop(layout.CONFIG)
    texts = recorded.text, recorded.values, contents
    mended = list_unrecorded(folder) if mends else ()
    changes = find_changes(manifest, experiment, *texts, places)
    check_unchanged(folder, manifest, (name for name in changes if name not in mended))
    if warns:
        for name, before, now in list_other_versions(manifest, experiment, recorded.values):
            LOGGER.warning(
                "%s: %s was %s when the run was recorded, and is now %s; new missions may differ "
                "from recorded ones",
                *(folder, name, before, now),
            )
    typed = manifest.get(layout.OVERRIDES, ())
    choices, own = manifest.get("choices", {}), manifest.get(layout.CONFIG_DIR)
    config = replace(config, choices=choices, overrides=typed, config_dir=own)
    return Rebuilt(experiment, number, config)


@contextmanager
def change_to_origin(manifest: Mapping[str, Any]) -> Iterator[None]:
    """Change to the folder in which the run was started, the base of its relative paths."""
    origin = Path(str(manifest.get("working_directory", ".")))
    with chdir(origin if origin.is_dir() else Path.cwd()):
        yield


def _read_manifest(folder: Path) -> Mapping[str, Any]:
    if folder.is_dir():
        require_no_links(folder)
    require_whole(folder)
    if not (folder / layout.CONFIG).is_file() or not (folder / layout.MANIFEST).is_file():
        swept = any(layout.folders_below(folder, lambda _: None))
        fix = "repeat the command of its sweep, which continues unfinished jobs"
        raise InputError(
            f"{folder}: must be the folder of a run, with {layout.CONFIG} and {layout.MANIFEST}; "
            f"{fix if swept else 'give such a folder'}"
        )
    return read_sealed(folder, layout.MANIFEST)


def plan_row(
    experiment: Experiment, designs: Mapping[int, Design], key: MissionKey, row: Mapping[str, str]
) -> tuple[Mission, Scenario]:
    """Plan the mission ``key`` of a row of ``missions.csv``; return it and its scenario."""
    generation, design, world, trial = key
    purpose = row.get("purpose", experiment.evaluation_draws)
    setting = experiment.conditions.get(row.get(CASE, ""))
    case = Case.parse(row[CASE]) if row.get(CASE) and setting is None else None
    scenario = experiment.scenario_for(purpose)
    if setting is not None or trial >= MOST_REPEATS:
        scenario = experiment.scenario_under(setting or STATED)
    text = "" if setting is None else setting.text
    place = (generation, design, designs[design], world, trial)
    return Mission(*place, purpose, row["draws"], case, text), scenario
