"""Conditions on the factors or configuration keys of runs, as in ``failure=none,random``."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from evoros.base.errors import InputError, single_line

from .factors import TARGET, Factor, find_factors, format_level, name_part
from .records import Record

Conditions = Mapping[str, Sequence[str]]  # allowed levels by factor


def parse_conditions(texts: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Parse conditions ``FACTOR=LEVEL,LEVEL...``; levels of the same factor are combined."""
    conditions: dict[str, tuple[str, ...]] = {}
    for text in texts:
        factor, _, levels = (part.strip() for part in text.partition("="))
        given = tuple(filter(None, (level.strip() for level in levels.split(","))))
        if not factor or not given:
            raise InputError(
                f"--where: must have the form FACTOR=LEVEL or FACTOR=LEVEL,LEVEL..., not {text!r}; "
                f"type failure=none, for example"
            )
        conditions[factor] = (*conditions.get(factor, ()), *given)
    return conditions


def read_levels(given: Mapping[Any, Any]) -> dict[str, tuple[str, ...]]:
    """Read conditions from YAML: a level or a list of levels by factor."""
    return {
        str(name): tuple(
            format_level({"": level}, "") for level in (v if isinstance(v, list) else [v])
        )
        for name, v in given.items()
    }


def find_record_factors(records: Sequence[Record]) -> list[Factor]:
    """Find the factors that differ between the records."""
    return find_factors(
        [r.values for r in records], [r.choices for r in records], [r.given for r in records]
    )


def require_levels(records: Sequence[Record], name: str, source: str) -> list[str]:
    """Return each record's level of a factor or key; ``source`` prefixes messages.

    ``name`` may be the column name, the words or the key of a factor, or the end of a configuration
    key; ``treatment`` stands for the treatment's given name.
    """
    wanted, factors = name.replace("_", " "), find_record_factors(records)
    for factor in factors:
        if name == factor.key or wanted == factor.name.replace("_", " "):
            return list(factor.levels)
    if name == "treatment" and any(record.given.get("name") for record in records):
        return [str(record.given.get("name", "")) for record in records]
    keys = list(dict.fromkeys(key for record in records for key in (*record.values, *record.given)))
    parts = [key.removesuffix(f".{TARGET}") for key in keys if key != TARGET]
    known = [key for key in dict.fromkeys(parts) if f".{key}".endswith(f".{name}")]
    if not known:
        there = ", ".join(factor.name for factor in factors)
        raise InputError(
            f"{source}: {name!r} is neither a factor nor a key of the runs; their factors are "
            f"{there or 'none, as all runs belong to one treatment'}"
        )
    key = min(known, key=lambda name: name.count("."))
    return [
        format_level({**record.values, **record.given}, key)
        if key in record.given or key in record.values
        else name_part(key, record.values, record.choices)
        for record in records
    ]


def is_level(level: str, wanted: str) -> bool:
    """Return True if a level equals ``wanted`` as a number, or as text with ``_`` for a space."""
    if level.replace("_", " ") == wanted.replace("_", " "):
        return True
    try:
        return float(level) == float(wanted)
    except ValueError:
        return False


def select_rows(records: Sequence[Record], conditions: Conditions, source: str) -> list[bool]:
    """Return True for each record that meets all conditions; ``source`` prefixes messages."""
    chosen = [True] * len(records)
    for name, allowed in conditions.items():
        levels = require_levels(records, name, source)
        for wanted in allowed:
            if not any(is_level(level, wanted) for level in levels):
                there = ", ".join(dict.fromkeys(filter(None, levels)))
                raise InputError(f"{source}: {name} must be one of {there}, not {wanted!r}")
        rows = match_levels(levels, allowed)
        chosen = [was and fits for was, fits in zip(chosen, rows, strict=True)]
    return chosen


def match_levels(levels: Sequence[str], allowed: Sequence[str]) -> list[bool]:
    """Return True for each level that is allowed."""
    return [any(is_level(level, wanted) for wanted in allowed) for level in levels]


def _describe(error: UnicodeDecodeError | yaml.YAMLError) -> str:
    if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark is not None:
        return f"line {error.problem_mark.line + 1}: {error.problem}"
    return single_line(error)


def read_entries(path: Path, content: str, keys: str, begin: str) -> Sequence[object]:
    """Read the list in a YAML file; ``content``, ``keys`` and ``begin`` are used in messages."""
    try:
        entries = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); give a YAML file with {content}"
        ) from error
    except (UnicodeDecodeError, yaml.YAMLError) as error:
        raise InputError(
            f"{path}: not valid YAML ({_describe(error)}); correct the syntax"
        ) from error
    if not isinstance(entries, list) or not entries:
        raise InputError(
            f'{path}: must be a list of {content}, each with {keys}; write "{begin}" for each entry'
        )
    return entries
