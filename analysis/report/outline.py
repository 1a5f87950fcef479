"""A configuration in a few lines: each part's class and numbers, and what differs between runs."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from ..tables.records import Record
from ..tables.treatments import IGNORED, TARGET, part_name


def outline(values: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Part, class and values of each part of a configuration, its loose values as ``run`` last.

    What is empty, and where missions were computed, is left out.
    """
    groups: dict[str, dict[str, Any]] = {}
    loose: dict[str, Any] = {}
    for key, value in values.items():
        first, _, rest = key.partition(".")
        if first in ("executor", "figures"):
            continue
        if rest:
            groups.setdefault(first, {})[rest] = value
        elif first != TARGET:
            loose[first] = value
    return [*((name, *_part(inner)) for name, inner in groups.items()), ("run", "", _pairs(loose))]


def _part(inner: Mapping[str, Any]) -> tuple[str, str]:
    """Class and values; of a part in it the class, of a set of parts their names."""
    own = {key: value for key, value in inner.items() if "." not in key and key != TARGET}
    below: dict[str, dict[str, None]] = {}
    for key in inner:
        first, *rest = key.split(".")
        if rest:
            below.setdefault(first, {})[rest[0]] = None
    if TARGET not in inner:
        return "", "; ".join(filter(None, [_pairs(own), ", ".join(below)]))
    said = [_pairs(own)]
    for name, keys in below.items():
        target = inner.get(f"{name}.{TARGET}")
        said.append(f"{name}: {part_name(target) if target else ', '.join(keys)}")
    return part_name(inner[TARGET]), "; ".join(filter(None, said))


def _pairs(values: Mapping[str, Any]) -> str:
    kept = {key: value for key, value in values.items() if value not in ({}, [], "")}
    return ", ".join(f"{key} {shown(value)}" for key, value in kept.items())


def shown(value: object) -> str:
    """A value as YAML has it."""
    if value is None:
        return "null"
    return str(value).lower() if isinstance(value, bool) else str(value)


def differences_of(records: Sequence[Record]) -> pd.DataFrame:
    """A row for each key in which treatments differ, a column for each treatment."""
    first = {record.treatment: record.values for record in reversed(records)}
    treatments = list(dict.fromkeys(record.treatment for record in records))
    keys = dict.fromkeys(key for name in treatments for key in first[name])
    rows = []
    for key in keys:
        cells = [shown(first[name][key]) if key in first[name] else "" for name in treatments]
        if len(set(cells)) > 1 and key.split(".")[0] not in IGNORED:
            rows.append([key, *cells])
    return pd.DataFrame(rows, columns=["key", *treatments])
