"""Names of treatments, and conditions on factors or keys (``failure=none,random``).

In a file of treatments, each entry selects runs by ``where`` or ``folders`` (patterns of names).
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from evoros.base.errors import InputError, single_line
from evoros.evolution.treatment import describe_problem
from evoros.files.plugins import conf_folders
from evoros.terminal.log import LOGGER

from .factors import (
    TARGET,
    Choices,
    Factor,
    Given,
    Values,
    find_factors,
    follows,
    format_level,
    list_conditions,
    name_part,
)
from .records import SECRET, Record

_SELECTING = ("where", "folders")
SINGLE = "all runs"  # label of the only treatment
LABEL_LENGTH = 60  # maximum length of labels; longer labels omit levels that follow from others
LEVEL_LENGTH = 24  # maximum number of characters of a level in a label
UNITS = {"m": "m", "s": "s", "deg": "deg", "rad": "rad", "mps": "m/s", "kg": "kg"}
_TITLE = re.compile(r"# @title (.+)")  # first line of an option's YAML file


@cache
def _read_titles() -> dict[str, str]:
    files = (file for folder in conf_folders() for file in folder.rglob("*.yaml"))
    titles = ((file.stem, _TITLE.match(file.read_text(encoding="utf-8"))) for file in files)
    return {choice: title[1] for choice, title in titles if title}


def label_treatments(
    configurations: Sequence[Values], choices: Sequence[Choices] = (), given: Sequence[Given] = ()
) -> list[str]:
    """Label configurations by given names or factor levels; labels are equal within a treatment."""
    factors = find_factors(configurations, choices, given)
    conditions = list_conditions(configurations, given)
    names = [str(levels.get("name", "")) for levels in given] or [""] * len(configurations)
    shown = _label_levels(factors, len(configurations))
    for name in dict.fromkeys(filter(None, names)):
        same = [i for i, other in enumerate(names) if other == name]
        part = [replace(f, levels=tuple(f.levels[i] for i in same)) for f in factors]
        differ = _label_levels([f for f in part if len(set(f.levels)) > 1], len(same))
        for i, label in zip(same, differ, strict=True):
            shown[i] = name if label == SINGLE else f"{name}, {label}"
    labels: dict[object, str] = {}
    for condition, label in zip(conditions, shown, strict=True):
        if condition not in labels:
            namesakes = sum(known.partition(" #")[0] == label for known in labels.values())
            labels[condition] = f"{label} #{namesakes + 1}" if namesakes else label
    return [labels[condition] for condition in conditions]


def _label_levels(factors: Sequence[Factor], count: int) -> list[str]:
    labels = _join(factors, count)
    if max(map(len, labels), default=0) > LABEL_LENGTH:
        kept: list[Factor] = []
        for factor in factors:
            if not follows(factor.levels, [f.levels for f in kept]):
                kept.append(factor)
        labels = _join(kept, count)
    return labels


def _join(factors: Sequence[Factor], count: int) -> list[str]:
    if len(factors) == 1 and factors[0].named and all(factors[0].levels):
        return [describe_level(level) for level in factors[0].levels]
    keys = [factor.key for factor in factors]
    inner = [any(f.key.startswith(f"{key}.") for key in keys) for f in factors]
    pairs = list(zip(factors, inner, strict=True))
    return [
        ", ".join(filter(None, (_describe(f, f.levels[i], inside) for f, inside in pairs)))
        or SINGLE
        for i in range(count)
    ]


def describe_factor(name: str) -> str:
    """Return the label of a factor with its unit: ``wait [s]`` for ``wait_s``."""
    words, unit = _split(name)
    return f"{words} [{unit}]" if unit else words


def _split(name: str) -> tuple[str, str]:
    start, _, end = name.rpartition("_")
    words = start if start and end in UNITS else name
    return words.replace("_", " ").replace(".", " "), UNITS[end] if words == start else ""


def _describe(factor: Factor, level: str, inside: bool) -> str:
    words, unit = _split(factor.name)
    if not level:
        return "" if inside else f"no {words}"
    return f"{words} {describe_level(level)}" + (f" {unit}" if unit else "")


def describe_level(level: str) -> str:
    """Return the label of a level, as usually written, and shortened if long."""
    if level.startswith(SECRET):
        return SECRET.strip()
    text = _read_titles().get(level, level.replace("_", " "))
    return text if len(text) <= LEVEL_LENGTH else text[: LEVEL_LENGTH - 3] + "..."


Conditions = Mapping[str, Sequence[str]]  # allowed levels by factor


def find_record_factors(records: Sequence[Record]) -> list[Factor]:
    """Find the factors that differ between records."""
    return find_factors(
        [r.values for r in records], [r.choices for r in records], [r.given for r in records]
    )


def parse_conditions(texts: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Parse conditions ``FACTOR=LEVEL,LEVEL...``; combine levels of the same factor."""
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
    """Read conditions from YAML: for each factor, a level or a list of levels."""
    return {
        str(name): tuple(
            format_level({"": level}, "") for level in (v if isinstance(v, list) else [v])
        )
        for name, v in given.items()
    }


def require_levels(records: Sequence[Record], name: str, source: str) -> list[str]:
    """Return the level of a factor or key in each record; ``source`` starts error messages.

    ``name`` may be the column, words or key of a factor, or the end of a configuration key;
    ``treatment`` is the given name of the treatment.
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
    """Return a mask of the records that meet all conditions; ``source`` starts error messages."""
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
    """Return a mask of the allowed levels."""
    return [any(is_level(level, wanted) for wanted in allowed) for level in levels]


def _describe_yaml(error: UnicodeDecodeError | yaml.YAMLError) -> str:
    if isinstance(error, yaml.MarkedYAMLError) and error.problem_mark is not None:
        return f"line {error.problem_mark.line + 1}: {error.problem}"
    return single_line(error)


def read_entries(path: Path, content: str, keys: str, begin: str) -> Sequence[object]:
    """Read a list from a YAML file; the other arguments are for error messages."""
    try:
        entries = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); give a YAML file with {content}"
        ) from error
    except (UnicodeDecodeError, yaml.YAMLError) as error:
        raise InputError(
            f"{path}: not valid YAML ({_describe_yaml(error)}); correct the syntax"
        ) from error
    if not isinstance(entries, list) or not entries:
        raise InputError(
            f'{path}: must be a list of {content}, each with {keys}; write "{begin}" for each entry'
        )
    return entries


@dataclass(frozen=True)
class _Entry:
    """An entry in a file of treatments."""

    given: Mapping[str, Any]  # name, and levels by factor
    where: Conditions
    folders: Sequence[str]

    @property
    def name(self) -> str:
        return str(self.given["name"])


def read_treatments(path: Path) -> list[_Entry]:
    """Read treatments from a YAML file."""
    entries = read_entries(path, "treatments", "a name, and either where or folders", "- name: ...")
    named = [_read_entry(entry, f"{path}, entry {i}") for i, entry in enumerate(entries, 1)]
    names = [entry.name for entry in named]
    for name in names:
        if names.count(name) > 1:
            raise InputError(
                f"{path}: the name {name!r} is used {names.count(name)} times; rename all but one"
            )
    return named


def _read_entry(entry: object, place: str) -> _Entry:
    if not isinstance(entry, dict) or not any(key in entry for key in _SELECTING):
        raise InputError(
            f"{place}: needs the keys name, and where (levels of factors) or folders (patterns "
            f"of run names); add these keys, as in {{name: GA, where: {{optimizer: ga}}}}"
        )
    given = {str(key): value for key, value in entry.items() if key not in _SELECTING}
    problem = describe_problem(given) or ("" if given.get("name") else "name must be a string")
    where, folders = entry.get("where") or {}, entry.get("folders") or []
    patterns = [folders] if isinstance(folders, str) else folders
    if not isinstance(where, dict):
        problem = problem or f"where must be a mapping of factors to levels, not {where!r}"
    if not isinstance(patterns, list) or not all(isinstance(name, str) for name in patterns):
        problem = problem or f"folders must be a list of patterns, not {folders!r}"
    if problem:
        raise InputError(f"{place}: {problem}")
    return _Entry(given, read_levels(where), patterns)


def name_treatments(
    records: Sequence[Record], entries: Sequence[_Entry], path: Path
) -> tuple[list[Record], dict[str, str]]:
    """Name each record after the only matching entry; return problems by record name."""
    fitting = [_fit(records, entry, path) for entry in entries]
    labels = _label_levels(find_record_factors(records), len(records))
    named, problems = [*records], dict[str, str]()
    for i, record in enumerate(records):
        chosen = [entry for entry, rows in zip(entries, fitting, strict=True) if rows[i]]
        about = f"{labels[i]} ({record.name})"
        if len(chosen) != 1:
            names = " and ".join(repr(entry.name) for entry in chosen)
            problem = f"matches both {names}" if chosen else "matches no entry"
            fix = "narrow their conditions" if chosen else "add an entry"
            problems[record.name] = (
                f"{path}: each run must match exactly one entry, but {about} {problem}; {fix}"
            )
        else:
            named[i] = replace(record, given=chosen[0].given)
    for entry, rows in zip(entries, fitting, strict=True):
        if not any(rows):
            LOGGER.warning(
                "%s: %r matches no run; check the spelling of its levels and folders",
                path,
                entry.name,
            )
    return named, problems


def _fit(records: Sequence[Record], entry: _Entry, path: Path) -> list[bool]:
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
