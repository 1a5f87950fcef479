"""The factors of a study: parts (``failure``), values, and the user's levels (``treatment``)."""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

# Top-level keys that may differ between replicates; treatments are read separately.
IGNORED = ("seed", "executor", "observers", "figures", "record", "treatment")
TARGET = "_target_"
RESERVED = ("name", "run", "treatment", "seed")  # names not allowed for factors
Values = Mapping[str, Any]  # configuration values by dotted key
Choices = Mapping[str, str]  # option of each group, by the dotted key of the configured part
Given = Mapping[str, Any]  # name of a treatment and levels by factor, as given by the user
_WORLD = "world"
_MANY = 24  # maximum length of a label that lists world names


@dataclass(frozen=True)
class Factor:
    """A factor and its level in each run."""

    key: str  # dotted configuration key, or a name given by the user
    name: str  # column name: the shortest suffix of the key that is unique among the factors
    levels: tuple[str, ...]  # one per run; empty if the run has no level
    named: bool = False  # whether the levels are self-explanatory names
    whole: bool = False  # whether the factor may determine any key


def read_choices(recorded: object) -> dict[str, str]:
    """Return the choices by key: ``failure.effect`` replaces ``filter@failure.effect``."""
    groups = recorded if isinstance(recorded, dict) else {}
    return {
        str(group).rpartition("@")[2].replace("/", "."): choice
        for group, choice in groups.items()
        if isinstance(choice, str)
    }


def read_given(values: Values) -> dict[str, Any]:
    """Return the name and levels that a configuration gives its treatment; empty if none."""
    start = "treatment."
    named = {k.removeprefix(start): v for k, v in values.items() if k.startswith(start)}
    return {key: value for key, value in named.items() if value is not None}


def name_part(key: str, values: Values, choices: Choices) -> str:
    """Return the name of the part at a dotted key: the option of its group, or else its class."""
    return choices.get(key) or _name_class(key, values)


def find_factors(
    configurations: Sequence[Values], choices: Sequence[Choices] = (), given: Sequence[Given] = ()
) -> list[Factor]:
    """Find the factors that differ between configurations; factors given by the user come first.

    Two configurations have the same levels if and only if they are equal apart from ``IGNORED``
    keys and have the same given levels. A key is no separate factor if its value follows from the
    given factors, the chosen experiment, or an enclosing part.
    """
    compared = [_select(values) for values in configurations]
    keys = list(dict.fromkeys(key for values in compared for key in values))
    columns = {key: tuple(repr(v.get(key, "absent")) for v in compared) for key in keys}
    differing = {key: column for key, column in columns.items() if len(set(column)) > 1}
    chosen = choices or [{}] * len(compared)
    factors = list(_find_given(given))
    factors += _find_global(keys, differing, chosen)
    for part in _list_parts(differing):
        factors += _find_part(part, differing, compared, chosen, factors)
    loose = [
        Factor(key, key, tuple(format_level(v, key) for v in compared))
        for key, column in differing.items()
        if not follows(column, _around(key, factors))
        and not any(other.startswith(f"{key}.") for other in keys)
    ]
    return _name([*factors, *_drop_references(loose)])


def format_level(values: Values, key: str) -> str:
    """Format the value of a key as in YAML; empty if the key is missing."""
    if key not in values:
        return ""
    value = values[key]
    if value in ({}, []):
        return "none"
    return str(value).rpartition(".")[2] if key.endswith(TARGET) else format_value(value)


def format_value(value: object) -> str:
    """Format a value as in YAML."""
    if value is None:
        return "null"
    return str(value).lower() if isinstance(value, bool) else str(value)


def list_conditions(
    configurations: Sequence[Values], given: Sequence[Given] = ()
) -> list[tuple[tuple[str, str], ...]]:
    """Return the values of each configuration that identify its treatment, without ``IGNORED``."""
    named = given or [{}] * len(configurations)
    return [
        tuple(
            (key, repr(value))
            for mapping in (_select(values), {f"treatment.{k}": v for k, v in treatment.items()})
            for key, value in sorted(mapping.items())
        )
        for values, treatment in zip(configurations, named, strict=True)
    ]


def _select(values: Values) -> dict[str, Any]:
    return {key: value for key, value in values.items() if key.split(".")[0] not in IGNORED}


def _find_given(given: Sequence[Given]) -> Iterator[Factor]:
    for key in dict.fromkeys(key for treatment in given for key in treatment if key != "name"):
        levels = tuple(format_level(treatment, key) for treatment in given)
        named = any(isinstance(treatment.get(key), str) for treatment in given)
        if len(set(levels)) > 1:
            yield Factor(key, key, levels, named, whole=True)


def _find_global(
    keys: Collection[str], differing: Mapping[str, tuple[str, ...]], choices: Sequence[Choices]
) -> Iterator[Factor]:
    for group in choices[0] if choices else ():
        levels = tuple(chosen.get(group, "") for chosen in choices)
        placed = group in IGNORED or any(f"{key}.".startswith(f"{group}.") for key in keys)
        # Equal values are one level, even if their options have different names.
        differ = len(set(levels)) > 1 and follows(levels, differing.values())
        if all(levels) and differ and not placed:
            yield Factor(group, group, levels, named=True, whole=True)


def _list_parts(differing: Mapping[str, object]) -> list[str]:
    ends = dict.fromkeys(
        ".".join(key.split(".")[:depth])
        for key in differing
        for depth in range(1, key.count(".") + 1)
    )
    return sorted(ends, key=lambda part: part.count("."))


def _find_part(
    part: str,
    differing: Mapping[str, tuple[str, ...]],
    compared: Sequence[Values],
    choices: Sequence[Choices],
    known: Sequence[Factor],
) -> Iterator[Factor]:
    below = {k: column for k, column in differing.items() if k.startswith(f"{part}.")}
    around = _around(part, known)
    if all(follows(column, around) for column in below.values()):
        return
    for levels in _name_levels(part, compared, choices):
        if len(set(levels)) > 1 and follows(levels, below.values()):
            if not follows(levels, around):
                yield Factor(part, part, levels, named=True)
            return


def _name_levels(
    part: str, compared: Sequence[Values], choices: Sequence[Choices]
) -> Iterator[tuple[str, ...]]:
    if part == _WORLD:
        worlds = [
            dict.fromkeys(key.split(".")[1] for key in values if key.startswith("world."))
            for values in compared
        ]
        sets = tuple("+".join(names) for names in worlds)
        picked = tuple(chosen.get(part, "") for chosen in choices)
        plain = all(re.fullmatch(r"[\w-]+", name) for name in picked)
        if plain and len(set(sets)) == len(set(picked)) and max(map(len, sets)) > _MANY:
            yield picked
        yield sets
    yield tuple(map(partial(_name_level, part), compared, choices))
    yield tuple(_name_class(part, values) for values in compared)


def _name_level(part: str, values: Values, choices: Choices) -> str:
    there = any(key.startswith(f"{part}.") for key in values)
    nothing = choices.get(part) == "none" or values.get(part) == {}
    return name_part(part, values, choices) if there or nothing else ""


def _name_class(key: str, values: Values) -> str:
    return str(values.get(f"{key}.{TARGET}", "")).rpartition(".")[2]


def _around(key: str, factors: Sequence[Factor]) -> list[tuple[str, ...]]:
    """Return the levels of ``whole`` factors and of enclosing parts, which may determine a key."""
    return [f.levels for f in factors if f.whole or key.startswith(f"{f.key}.")]


def follows(column: Sequence[str], others: Collection[Sequence[str]]) -> bool:
    """Return True if the other columns determine the values of this column."""
    known: dict[tuple[str, ...], str] = {}
    rows = zip(*others, strict=True) if others else ((),) * len(column)
    return all(known.setdefault(row, v) == v for row, v in zip(rows, column, strict=True))


def _drop_references(factors: Sequence[Factor]) -> list[Factor]:
    """Keep only the shortest of several keys with the same last part and the same levels."""
    best: dict[tuple[str, tuple[str, ...]], Factor] = {}
    for factor in factors:
        same = (factor.key.rpartition(".")[2], factor.levels)
        if same not in best or factor.key.count(".") < best[same].key.count("."):
            best[same] = factor
    return list(best.values())


def _name(factors: Sequence[Factor]) -> list[Factor]:
    """Name each factor by the shortest suffix of its key that is unique among the factors."""
    ends = [
        [".".join(parts[-n:]) for n in range(1, len(parts) + 1)]
        for parts in (f.key.removesuffix(f".{TARGET}").split(".") for f in factors)
    ]
    taken = [end for keys in ends for end in keys]
    return [
        replace(f, name=next((e for e in keys if taken.count(e) == 1 and e not in RESERVED), f.key))
        for f, keys in zip(factors, ends, strict=True)
    ]
