"""Loads all complete runs and evaluations in folders as a study."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

from evoros.base.errors import (
    InputError,
    escape,
    explain_path,
    list_names,
    shell_line,
    single_line,
)
from evoros.storage.archives import open_folder
from evoros.storage.circumstances import COMPUTING
from evoros.storage.layout import folders_below
from evoros.storage.verification import list_strays
from evoros.terminal.log import LOGGER, warn_left_out

from . import treatments as naming
from .factors import list_conditions, read_given
from .records import EvaluationRecord, Record, read_record
from .study import AnyRecord, Study

_MOST_SPACES = 3  # maximum number of spaces for which a path without quotes is rejoined


def load_study(
    folders: Sequence[str | Path], where: Sequence[str] = (), treatments: Path | None = None
) -> Study:
    """Load the complete runs and evaluations below folders; report all other folders.

    ``where`` holds conditions on the runs, such as ``failure=none``; in a study without runs, they
    apply to evaluations. ``treatments`` is a file that names the treatments.

    Raises:
        InputError: no complete folder was found, or no run meets the conditions.
    """
    conditions = naming.parse_conditions(where)
    paths = [open_folder(folder) for folder in folders]
    records, left_out = _read(find_folders(paths))
    if not records:
        raise InputError(
            f"{', '.join(map(str, paths))}: no complete run or evaluation was found; "
            f"see the warnings above"
        )
    for record in records:
        if record.not_run:
            LOGGER.warning("%s: %s", record.path, record.not_run)
        for file in list_strays(record.path):
            LOGGER.warning("%s: ignored, because the run did not write this file", file)
    evaluations = [record for record in records if isinstance(record, EvaluationRecord)]
    runs = [record for record in records if not isinstance(record, EvaluationRecord)]
    problems = dict[str, str]()
    if treatments is not None:
        runs, problems = naming.name_treatments(
            runs, naming.read_treatments(treatments), treatments
        )
    if runs:
        selected = _select(runs, conditions)
        for run in selected:
            if run.name in problems:
                raise InputError(problems[run.name])
        given = _label(selected)
        copies = _name_copies(given)
        counted = tuple(run for run in given if run.name not in copies)
        _report_versions(counted)
        return Study(counted, _label(evaluations), tuple(left_out), given)
    return Study((), _label(_select(evaluations, conditions)), tuple(left_out))


def _read(folders: Sequence[Path]) -> tuple[list[Record], list[str]]:
    names = shorten_names(folders)
    records, left_out = list[Record](), list[str]()
    for folder in folders:
        try:
            records.append(read_record(folder, names[folder]))
        except InputError as error:
            LOGGER.warning("%s; left out", error)
            left_out.append(str(error))
        except Exception as error:  # a malformed file must not affect other folders
            reason = explain_path(error) or (
                f"{folder}: cannot be read ({single_line(f'{type(error).__name__}: {error}')}); "
                f"restore it from a copy"
            )
            LOGGER.warning("%s; left out", reason)
            left_out.append(reason)
    return records, left_out


def _name_copies(runs: Sequence[Record]) -> set[str]:
    """Report runs that repeat a configuration and seed, except the most advanced; return names."""
    values = [run.values for run in runs]
    conditions = list_conditions(values, [*map(read_given, values)])
    alike: dict[object, list[Record]] = {}
    for run, condition in zip(runs, conditions, strict=True):
        alike.setdefault((condition, run.seed), []).append(run)
    copies = dict[str, str]()
    for group in alike.values():
        best = max(group, key=lambda run: (run.finished, run.generations_done))
        copies |= {run.name: f"{run.name} (as {best.name})" for run in group if run is not best}
    if copies:
        LOGGER.warning(
            "runs with the configuration and seed of another run are left out: %s",
            list_names([*copies.values()]),
        )
    return set(copies)


def _report_versions(runs: Sequence[Record]) -> None:
    made: dict[str, list[str]] = {}
    for run in runs:
        manifest = run.run.manifest
        changed = " and changed files" * bool(manifest.get("dirty"))
        versions = [f"commit {manifest.get('commit') or 'unknown'}{changed}"]
        packages = manifest.get("packages") or {}
        versions += [f"{name} {packages.get(name) or 'unknown'}" for name in COMPUTING]
        made.setdefault(", ".join(versions), []).append(run.name)
    if len(made) > 1:
        LOGGER.warning(
            "the runs used different versions, which may explain differences in results: %s",
            "; ".join(f"{', '.join(names)} used {versions}" for versions, names in made.items()),
        )


def _select(records: Sequence[AnyRecord], conditions: naming.Conditions) -> list[AnyRecord]:
    chosen = naming.select_rows(records, conditions, "--where")
    kept = [record for record, fits in zip(records, chosen, strict=True) if fits]
    if records and not kept:
        raise InputError(
            f"--where: none of {len(records)} runs meets all conditions; remove a condition"
        )
    return kept


def _label(records: Sequence[AnyRecord]) -> tuple[AnyRecord, ...]:
    names = naming.label_treatments(
        [r.values for r in records], [r.choices for r in records], [r.given for r in records]
    )
    factors = naming.find_record_factors(records)
    levels = [{factor.name: factor.levels[i] for factor in factors} for i in range(len(records))]
    return tuple(
        replace(record, treatment=name, levels=level)
        for record, name, level in zip(records, names, levels, strict=True)
    )


def find_folders(paths: Sequence[Path]) -> list[Path]:
    """Return the run and evaluation folders below some paths, without duplicates."""
    folders: dict[Path, Path] = {}
    for i, path in enumerate(paths):
        if not path.is_dir():
            raise InputError(f"{path}: folder not found; {_advise(paths, i)}")
        below = list(folders_below(path, warn_left_out))
        if not below:
            LOGGER.warning("%s contains no runs and is left out", path)
        for folder in below:
            folders.setdefault(folder.resolve(), folder)
    return list(folders.values())


def _advise(paths: Sequence[Path], missing: int) -> str:
    starts, ends = range(max(0, missing - _MOST_SPACES), missing + 1), range(1, _MOST_SPACES + 2)
    for start, length in product(starts, ends):
        whole = Path(" ".join(map(str, paths[start : start + length])))
        if whole.is_dir() and start <= missing < start + length:
            return f"a path with a space needs quotes: {shell_line(str(whole))}"
    return "check the spelling of the path"


def shorten_names(folders: Iterable[Path]) -> dict[Path, str]:
    """Name each folder by the shortest suffix of its path that is unique."""
    unnamed, names = {folder: folder.resolve().parts for folder in folders}, dict[Path, str]()
    length = 1
    while unnamed:
        ends = {folder: parts[-length:] for folder, parts in unnamed.items()}
        taken = list(ends.values())
        for folder, end in ends.items():
            if taken.count(end) == 1 or length >= len(unnamed[folder]):
                names[folder] = escape("/".join(end))
        unnamed = {folder: parts for folder, parts in unnamed.items() if folder not in names}
        length += 1
    return names
