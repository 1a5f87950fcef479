"""Loads the complete runs and evaluations in some folders as a study."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from evoros.base.errors import InputError, single_line
from evoros.files.disk import explain_rights
from evoros.storage.archives import open_folder
from evoros.storage.verification import list_strays
from evoros.terminal.log import LOGGER

from .conditions import Conditions, find_record_factors, parse_conditions, select_rows
from .folders import find_folders, shorten_names
from .records import EvaluationRecord, Record, read_record
from .study import AnyRecord, Study
from .treatments import label_treatments
from .treatments_file import name_treatments, read_treatments


def load_study(
    folders: Sequence[str | Path], where: Sequence[str] = (), treatments: Path | None = None
) -> Study:
    """Load the complete runs and evaluations below these folders; report each other folder.

    ``where`` has conditions on the runs, such as ``failure=none``, without runs on the
    evaluations. ``treatments`` is a file with the names of the treatments.

    Raises:
        InputError: no folder is complete, or no run meets the conditions.
    """
    conditions = parse_conditions(where)
    paths = [open_folder(folder) for folder in folders]
    records, left_out = _read(find_folders(paths))
    if not records:
        raise InputError(
            f"{', '.join(map(str, paths))}: must contain complete runs or evaluations, but "
            f"contains none; see the warnings above"
        )
    for record in records:
        if record.not_run:
            LOGGER.warning("%s: %s", record.path, record.not_run)
        for file in list_strays(record.path):
            LOGGER.warning("%s: is no table that the run has written; not read", file)
    evaluations = [record for record in records if isinstance(record, EvaluationRecord)]
    runs = [record for record in records if not isinstance(record, EvaluationRecord)]
    if treatments is not None:
        runs = list(name_treatments(runs, read_treatments(treatments), treatments))
    if runs:
        return Study(_label(_select(runs, conditions)), _label(evaluations), tuple(left_out))
    return Study((), _label(_select(evaluations, conditions)), tuple(left_out))


def _read(folders: Sequence[Path]) -> tuple[list[Record], list[str]]:
    """Read the folders; return those that can be read, and why the others cannot."""
    names = shorten_names(folders)
    records, left_out = list[Record](), list[str]()
    for folder in folders:
        try:
            records.append(read_record(folder, names[folder]))
        except InputError as error:
            LOGGER.warning("%s; left out", error)
            left_out.append(str(error))
        except Exception as error:  # a forged file may have anything; no other folder suffers
            reason = explain_rights(error) or (
                f"{folder}: cannot be read ({single_line(f'{type(error).__name__}: {error}')}); "
                f"restore it from a copy"
            )
            LOGGER.warning("%s; left out", reason)
            left_out.append(reason)
    return records, left_out


def _select(records: Sequence[AnyRecord], conditions: Conditions) -> list[AnyRecord]:
    """Keep the records that meet all conditions."""
    chosen = select_rows(records, conditions, "--where")
    kept = [record for record, fits in zip(records, chosen, strict=True) if fits]
    if records and not kept:
        raise InputError(
            f"--where: none of the {len(records)} runs meets all conditions; leave one out"
        )
    return kept


def _label(records: Sequence[AnyRecord]) -> tuple[AnyRecord, ...]:
    """Give each record the label of its treatment, and its levels of the factors."""
    names = label_treatments(
        [r.values for r in records], [r.choices for r in records], [r.given for r in records]
    )
    factors = find_record_factors(records)
    levels = [{factor.name: factor.levels[i] for factor in factors} for i in range(len(records))]
    return tuple(
        replace(record, treatment=name, levels=level)
        for record, name, level in zip(records, names, levels, strict=True)
    )
