"""Runs recorded runs and evaluations again, in new folders, to compare the bytes of both."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.config.configuration import Configuration
from evoros.config.recorded import find_difference, read_recorded
from evoros.session.design_tables import read_recorded_designs
from evoros.session.evaluation import open_evaluation, record_evaluation
from evoros.session.overview import survey
from evoros.session.resume import change_to_origin, rebuild
from evoros.session.run import open_run, record_run
from evoros.session.work import Work
from evoros.storage.discovery import folders_below
from evoros.storage.layout import (
    CONFIG,
    EVALUATE,
    FINISHED,
    MANIFEST,
    MISSIONS,
    RUN,
    advise_finish,
    command_of,
    read_json,
)
from evoros.storage.relocation import NOWHERE, Relocation
from evoros.storage.verification import verify_folder
from evoros.terminal.log import collect_messages, warn_left_out

EQUAL = "made with the same packages, commit, processor and operating system"


@dataclass(frozen=True)
class Reproduction:
    """One run or evaluation, and the folder in which it runs again."""

    source: Path
    folder: Path

    @property
    def config(self) -> Configuration:
        """The recorded configuration."""
        return read_recorded(self.source / CONFIG)


def list_reproductions(source: Path, output: Path) -> list[Reproduction]:
    """Pair the folder of a run, or each below a sweep's, with one of the same path in ``output``.

    Raises:
        InputError: there is none, one is damaged or not finished, or ``output`` lies in it.
    """
    if output.resolve().is_relative_to(source.resolve()):
        raise InputError(
            f"--output {output}: must not be in {source}, which stays as it is; choose another"
        )
    folders = list_finished(source, "reproduced")
    return [Reproduction(folder, output / folder.relative_to(source)) for folder in folders]


def list_finished(source: Path, purpose: str) -> list[Path]:
    """List the folders of runs and evaluations in a folder, which must be whole and finished.

    Raises:
        InputError: there is none, or one is damaged or not finished; it names the ``purpose``.
    """
    if not source.is_dir():
        raise InputError(f"{source}: must be the folder of a run, and there is none; correct it")
    folders = list(folders_below(source, warn_left_out))
    if not folders:
        raise InputError(
            f"{source}: must be the folder of a run, an evaluation or a sweep, and has none; "
            f"correct it"
        )
    for folder in folders:
        verify_folder(folder)  # so that nothing is mended, which would write into it
        if survey(folder).state != FINISHED:
            raise InputError(f"{folder}: must be finished to be {purpose}; {advise_finish(folder)}")
    return folders


def build_reproduction(
    reproduction: Reproduction,
    overrides: Sequence[str],
    config_dir: str | None,
    places: Relocation = NOWHERE,
) -> Work:
    """Build a run or an evaluation again, or go on with one that was begun.

    ``overrides`` may change the executor; ``config_dir`` has the modules of the user's own parts;
    ``places`` has the folders into which an archive was unpacked.

    Raises:
        InputError: something that it is made of has changed, another override, or the new folder
            has another run.
    """
    for text in overrides:
        if not text.startswith(("executor=", "executor.")):
            raise InputError(
                f"{text}: only executor and executor.* may change, because no result depends on "
                f"them; leave it out"
            )
    source, folder = reproduction.source, reproduction.folder.absolute()
    runs = command_of(source) == RUN
    generations = survey(source).wanted if runs else None  # it may have been extended
    if (folder / MISSIONS).exists():
        _require_same(reproduction)
        if not runs:
            return open_evaluation(folder, overrides, config_dir)
        typed = [*overrides, f"optimizer.generations={generations}"]
        return replace(open_run(folder, typed, config_dir), observed=False)
    with collect_messages() as messages:
        command = RUN if runs else EVALUATE
        experiment, _, config = rebuild(
            source, overrides, config_dir, command, warns=False, places=places
        )
        designs = [] if runs else read_recorded_designs(source, experiment)
        with change_to_origin(read_json(source / MANIFEST)):  # where relative paths begin
            if runs:
                run = record_run(experiment, config, folder, messages, generations)
                return replace(run, observed=False)
            return record_evaluation(experiment, designs, config, folder, messages)


def _require_same(reproduction: Reproduction) -> None:
    difference = find_difference(reproduction.config, read_recorded(reproduction.folder / CONFIG))
    if command_of(reproduction.folder) != command_of(reproduction.source) or difference:
        raise InputError(
            f"{reproduction.folder}: must be empty or a reproduction of {reproduction.source} "
            f"({difference or 'another command made it'}); choose another --output"
        )


def describe_circumstances(reproductions: Sequence[Reproduction]) -> str:
    """Describe in one line the versions, commit, processor and system that are not the same."""
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
