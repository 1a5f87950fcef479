"""Reruns recorded runs in new folders to compare the results byte by byte."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError, override
from evoros.config.configuration import Configuration
from evoros.config.recorded import find_difference, read_recorded
from evoros.evolution.stop_after import LIMITS, StopAfter
from evoros.mission.plan import GENERATIONS, find_growing
from evoros.preflight.preflight import preflight
from evoros.session.design_tables import read_recorded_designs
from evoros.session.rebuilding import change_to_origin, rebuild
from evoros.session.run import SIZES, Session, open_run, record_run
from evoros.session.status import survey
from evoros.storage.archives import NOWHERE, Relocation
from evoros.storage.layout import (
    CONFIG,
    FINISHED,
    MANIFEST,
    MISSIONS,
    STATUS,
    advise_finish,
    evaluates,
    folders_below,
    read_json,
)
from evoros.storage.verification import verify_folder
from evoros.terminal.log import collect_messages, warn_left_out

EQUAL = "made with the same packages, commit, processor and operating system"


@dataclass(frozen=True)
class Reproduction:
    """A recorded run, and the folder for its rerun."""

    source: Path
    folder: Path

    @property
    def config(self) -> Configuration:
        """The recorded configuration."""
        return read_recorded(self.source / CONFIG)


def list_reproductions(source: Path, output: Path) -> list[Reproduction]:
    """Pair a run folder, or each run of a sweep, with a folder of the same name in ``output``."""
    if output.resolve().is_relative_to(source.resolve()):
        raise InputError(f"--output {output}: must not be in {source}; choose another folder")
    folders = list_finished(source, "reproduced")
    return [Reproduction(folder, output / folder.relative_to(source)) for folder in folders]


def list_finished(source: Path, purpose: str) -> list[Path]:
    """List the run folders in ``source``, all of which must be undamaged and finished."""
    if not source.is_dir():
        raise InputError(f"{source}: folder not found; correct the path")
    folders = list(folders_below(source, warn_left_out))
    if not folders:
        raise InputError(
            f"{source}: must be the folder of a run, an evaluation or a sweep; correct the path"
        )
    for folder in folders:
        verify_folder(folder)  # rejects damage that opening the run would repair
        if survey(folder).state != FINISHED:
            raise InputError(f"{folder}: must be finished to be {purpose}; {advise_finish(folder)}")
    return folders


def build_reproduction(
    reproduction: Reproduction,
    overrides: Sequence[str],
    config_dir: str | None,
    places: Relocation = NOWHERE,
) -> Session:
    """Start the rerun of a run, or resume an unfinished rerun."""
    for text in overrides:
        if not text.startswith(("executor=", "executor.")):
            raise InputError(
                f"{text}: changes results; only executor and executor.* may change; leave it out"
            )
    source, folder = reproduction.source, reproduction.folder.absolute()
    values = reproduction.config.values
    key = find_growing(values) if evaluates(source) else GENERATIONS
    status = read_json(source / STATUS)
    size = status[SIZES[key]]  # the configured size, or a larger one if the run was extended
    limits = {} if evaluates(source) else {"generations": status["generations_done"]}
    if (folder / MISSIONS).exists():
        _require_same(reproduction)
        stop = [override(f"stop_after.{name}", limits.get(name)) for name in LIMITS if limits]
        session = open_run(folder, [*overrides, f"{key}={size}", *stop], config_dir)
        return replace(session, observed=False)
    with collect_messages() as messages:
        experiment, _, config = rebuild(source, overrides, config_dir, warns=False, places=places)
        experiment = replace(experiment, stop_after=StopAfter(**limits))
        preflight(experiment)
        designs = read_recorded_designs(source, experiment) if evaluates(source) else None
        with change_to_origin(read_json(source / MANIFEST)):  # the base folder of relative paths
            session = record_run(experiment, config, folder, messages, size, designs)
            return replace(session, observed=False)


def _require_same(reproduction: Reproduction) -> None:
    difference = find_difference(reproduction.config, read_recorded(reproduction.folder / CONFIG))
    if evaluates(reproduction.folder) != evaluates(reproduction.source) or difference:
        raise InputError(
            f"{reproduction.folder}: must be empty or a reproduction of {reproduction.source} "
            f"({difference or 'a different command made it'}); choose another --output"
        )


def describe_circumstances(reproductions: Sequence[Reproduction]) -> str:
    """Describe differences in versions, commits, processors and systems in one line."""
    changes: dict[str, None] = {}
    for pair in reproductions:
        old, new = (_flatten(read_json(path / MANIFEST)) for path in (pair.source, pair.folder))
        for name in dict.fromkeys((*new, *old)):
            now, before = new.get(name) or "unknown", old.get(name) or "unknown"
            if new.get(name) != old.get(name):
                changes[f"{name} {now} (was {before})"] = None
    return f"made with {', '.join(changes)}" if changes else EQUAL


def _flatten(manifest: Mapping[str, Any]) -> dict[str, str | None]:
    commit = manifest.get("commit")
    changed = " with changed files" if manifest.get("dirty") else ""
    return {
        "commit": f"{commit}{changed}" if commit else None,
        **manifest.get("packages", {}),
        **manifest.get("programs", {}),
        "Python": manifest.get("python"),
        "processor": manifest.get("processor"),
        "operating system": manifest.get("operating_system"),
        "platform": manifest.get("platform"),
    }
