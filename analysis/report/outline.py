"""A configuration in a few lines: names and values of the parts, and what differs between runs."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from ..tables.factors import IGNORED, TARGET, Choices, Values, name_part
from ..tables.records import Record
from ..tables.values import format_value


def outline(values: Values, choices: Choices) -> list[tuple[str, str, str]]:
    """List key, name and values of each part, without the executor; loose values are ``run``."""
    parts: dict[str, dict[str, Any]] = {}
    loose: dict[str, Any] = {}
    for key, value in values.items():
        first, _, below = key.partition(".")
        if first in ("executor", "figures"):
            continue
        if below:
            parts.setdefault(first, {})[below] = value
        elif first != TARGET:
            loose[first] = value
    rows = [_outline_part(key, inner, values, choices) for key, inner in parts.items()]
    return [*rows, ("run", "", _join(loose))]


def _outline_part(
    part: str, inner: Values, values: Values, choices: Choices
) -> tuple[str, str, str]:
    """Return key, name and values; parts inside are named, sets of parts list their keys."""
    values_here = {key: value for key, value in inner.items() if "." not in key and key != TARGET}
    below: dict[str, dict[str, None]] = {}
    for key in inner:
        first, *others = key.split(".")
        if others:
            below.setdefault(first, {})[others[0]] = None
    if TARGET not in inner:
        return part, "", "; ".join(filter(None, [_join(values_here), ", ".join(below)]))
    texts = [_join(values_here)]
    for name, keys in below.items():
        is_part = f"{name}.{TARGET}" in inner
        inside = name_part(f"{part}.{name}", values, choices) if is_part else ", ".join(keys)
        texts.append(f"{name}: {inside}")
    return part, name_part(part, values, choices), "; ".join(filter(None, texts))


def _join(values: Values) -> str:
    given = {key: value for key, value in values.items() if value not in ({}, [], "")}
    return ", ".join(f"{key} {format_value(value)}" for key, value in given.items())


def common_choices(records: Sequence[Record]) -> dict[str, str]:
    """Return the choices that all records have in common."""
    first, *others = (record.choices for record in records)
    return {
        key: choice for key, choice in first.items() if all(o.get(key) == choice for o in others)
    }


def tabulate_differences(records: Sequence[Record]) -> pd.DataFrame:
    """List the keys in which treatments differ: a row a key, a column a treatment."""
    first: Mapping[str, Values] = {r.treatment: r.values for r in reversed(records)}
    treatments = list(dict.fromkeys(record.treatment for record in records))
    keys = dict.fromkeys(key for name in treatments for key in first[name])
    rows = []
    for key in keys:
        cells = [
            format_value(first[name][key]) if key in first[name] else "" for name in treatments
        ]
        if len(set(cells)) > 1 and key.split(".")[0] not in IGNORED:
            rows.append([key, *cells])
    return pd.DataFrame(rows, columns=["key", *treatments])
