"""Names of treatments for folders that have none: the file of ``--treatments``.

It is a list of treatments as in a configuration, each with its runs: ``where``, levels of
factors, or ``folders``, patterns of the runs' names.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from evoros.base.errors import InputError
from evoros.evolution.treatment import describe_problem
from evoros.terminal.log import LOGGER

from .conditions import Conditions, find_record_factors, match_levels, read_levels, require_levels
from .entries import read_entries
from .records import Record
from .treatments import label_levels

SELECTING = ("where", "folders")


@dataclass(frozen=True)
class NamedTreatment:
    """An entry of the file."""

    given: Mapping[str, Any]  # name, and levels by factor
    where: Conditions
    folders: Sequence[str]

    @property
    def name(self) -> str:
        """The name of the treatment."""
        return str(self.given["name"])


def read_treatments(path: Path) -> list[NamedTreatment]:
    """Read the file."""
    entries = read_entries(path, "treatments", "name and where or folders", "- name: ...")
    named = [_read_entry(entry, f"{path}, entry {i}") for i, entry in enumerate(entries, 1)]
    names = [entry.name for entry in named]
    for name in names:
        if names.count(name) > 1:
            raise InputError(
                f"{path}: the name {name!r} must be there once, not {names.count(name)} times; "
                f"rename one"
            )
    return named


def _read_entry(entry: object, place: str) -> NamedTreatment:
    if not isinstance(entry, dict) or not any(key in entry for key in SELECTING):
        raise InputError(
            f"{place}: must have name, and where (levels of factors) or folders (patterns of the "
            f"names of runs); add them"
        )
    given = {str(key): value for key, value in entry.items() if key not in SELECTING}
    problem = describe_problem(given) or ("" if given.get("name") else "name must be a text")
    where, folders = entry.get("where") or {}, entry.get("folders") or []
    patterns = [folders] if isinstance(folders, str) else folders
    if not isinstance(where, dict):
        problem = problem or f"where must be a mapping of factors to levels, not {where!r}"
    if not isinstance(patterns, list) or not all(isinstance(name, str) for name in patterns):
        problem = problem or f"folders must be a list of patterns, not {folders!r}"
    if problem:
        raise InputError(f"{place}: {problem}; correct it")
    return NamedTreatment(given, read_levels(where), patterns)


def name_treatments(
    records: Sequence[Record], entries: Sequence[NamedTreatment], path: Path
) -> tuple[Record, ...]:
    """Give each record the name of the one entry that fits it; report entries that fit none."""
    fitting = [_fit(records, entry, path) for entry in entries]
    labels = label_levels(find_record_factors(records), len(records))
    named = []
    for i, record in enumerate(records):
        chosen = [entry for entry, rows in zip(entries, fitting, strict=True) if rows[i]]
        about = f"{labels[i]} ({record.name})"
        if len(chosen) != 1:
            names = " and ".join(repr(entry.name) for entry in chosen)
            problem = f"it is both {names}" if chosen else "no entry fits it"
            fix = "make where narrower" if chosen else "add an entry"
            raise InputError(
                f"{path}: each treatment must have one entry, and of {about}, {problem}; {fix}"
            )
        named.append(replace(record, given=chosen[0].given))
    for entry, rows in zip(entries, fitting, strict=True):
        if not any(rows):
            LOGGER.warning("%s: %r fits no run; is a level or a folder misspelt?", path, entry.name)
    return tuple(named)


def _fit(records: Sequence[Record], entry: NamedTreatment, path: Path) -> list[bool]:
    """Return which records fit an entry. Levels that none of them has fit none."""
    rows = [
        not entry.folders
        or any(fnmatch(r.name, p) or fnmatch(r.path.name, p) for p in entry.folders)
        for r in records
    ]
    for name, allowed in entry.where.items():
        levels = require_levels(records, name, f"{path}: where of {entry.name!r}")
        fitting = match_levels(levels, allowed)
        rows = [was and fits for was, fits in zip(rows, fitting, strict=True)]
    return rows
