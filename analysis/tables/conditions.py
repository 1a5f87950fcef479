"""Conditions on runs, as ``failure=none,random``: by factors, and by any key of configurations."""

from collections.abc import Mapping, Sequence
from typing import Any

from evoros.base.errors import InputError

from .factors import TARGET, Factor, find_factors, format_level, name_part
from .records import Record

Conditions = Mapping[str, Sequence[str]]
"""The allowed levels by factor."""


def parse_conditions(texts: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Parse conditions ``FACTOR=LEVEL,LEVEL...``; those on the same factor are united."""
    conditions: dict[str, tuple[str, ...]] = {}
    for text in texts:
        factor, _, levels = (part.strip() for part in text.partition("="))
        given = tuple(filter(None, (level.strip() for level in levels.split(","))))
        if not factor or not given:
            raise InputError(
                f"--where: must be FACTOR=LEVEL or FACTOR=LEVEL,LEVEL..., not {text!r}; write it so"
            )
        conditions[factor] = (*conditions.get(factor, ()), *given)
    return conditions


def read_levels(given: Mapping[Any, Any]) -> dict[str, tuple[str, ...]]:
    """Read conditions that a YAML file has, a level or a list of levels by factor."""
    return {
        str(name): tuple(
            format_level({"": level}, "") for level in (v if isinstance(v, list) else [v])
        )
        for name, v in given.items()
    }


def find_record_factors(records: Sequence[Record]) -> list[Factor]:
    """Find the factors in which records differ."""
    return find_factors(
        [r.values for r in records], [r.choices for r in records], [r.given for r in records]
    )


def find_levels(records: Sequence[Record], name: str) -> list[str] | None:
    """Return the level of each record of a factor or a key; None if none has such a key.

    Factors are named by column, words or key, keys by their end; ``treatment`` is a given name.
    """
    wanted = name.replace("_", " ")
    for factor in find_record_factors(records):
        if name == factor.key or wanted == factor.name.replace("_", " "):
            return list(factor.levels)
    if name == "treatment" and any(record.given.get("name") for record in records):
        return [str(record.given.get("name", "")) for record in records]
    keys = list(dict.fromkeys(key for record in records for key in (*record.values, *record.given)))
    parts = [key.removesuffix(f".{TARGET}") for key in keys if key != TARGET]
    known = [key for key in dict.fromkeys(parts) if f".{key}".endswith(f".{name}")]
    if not known:
        return None
    key = min(known, key=lambda name: name.count("."))
    return [
        format_level({**record.values, **record.given}, key)
        if key in record.given or key in record.values
        else name_part(key, record.values, record.choices)
        for record in records
    ]


def is_level(level: str, wanted: str) -> bool:
    """Whether a level is the wanted one: the same text, words or number."""
    if level.replace("_", " ") == wanted.replace("_", " "):
        return True
    try:
        return float(level) == float(wanted)
    except ValueError:
        return False


def select_rows(records: Sequence[Record], conditions: Conditions, source: str) -> list[bool]:
    """Return which records meet all conditions; ``source`` begins error messages."""
    chosen = [True] * len(records)
    for name, allowed in conditions.items():
        levels = require_levels(records, name, source)
        for wanted in allowed:
            if not any(is_level(level, wanted) for level in levels):
                there = ", ".join(dict.fromkeys(filter(None, levels)))
                raise InputError(
                    f"{source}: {name} must be one of {there}, not {wanted!r}; correct the level"
                )
        rows = match_levels(levels, allowed)
        chosen = [was and fits for was, fits in zip(chosen, rows, strict=True)]
    return chosen


def require_levels(records: Sequence[Record], name: str, source: str) -> list[str]:
    """Return the level of each record, as ``find_levels``."""
    levels = find_levels(records, name)
    if levels is None:
        factors = [factor.name for factor in find_record_factors(records)]
        there = ", ".join(factors) or "none, because all are of one treatment"
        raise InputError(
            f"{source}: must name a factor or a key of the runs, not {name!r}; their factors: "
            f"{there}"
        )
    return levels


def match_levels(levels: Sequence[str], allowed: Sequence[str]) -> list[bool]:
    """Return which levels are allowed."""
    return [any(is_level(level, wanted) for wanted in allowed) for level in levels]
