"""Labels of treatments: the names that the user has given them, else their levels."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import pandas as pd

from .factors import Choices, Factor, Given, Values, find_factors, follows, list_conditions
from .records import Record

SINGLE = "all runs"
"""The label if there is one treatment."""
LABEL_LENGTH = 60  # characters, beyond which levels that follow from others are left out
LEVEL_LENGTH = 24  # characters of a level in a label
UNITS = {"m": "m", "s": "s", "deg": "deg", "rad": "rad", "mps": "m/s", "kg": "kg"}
"""Units by the ends of keys."""
OWN_NAMES = {
    "cat_cma": "CatCMA",
    "cma_es": "CMA-ES",
    "cma_mae": "CMA-MAE",
    "ga": "GA",
    "map_elites": "MAP-Elites",
    "mujoco": "MuJoCo",
    "nsga2": "NSGA-II",
    "pybullet": "PyBullet",
    "set_cover": "set cover",
    "sobol": "Sobol'",
    "tpe": "TPE",
}
"""How the field writes what a choice has to write in small letters."""


def label_treatments(
    configurations: Sequence[Values], choices: Sequence[Choices] = (), given: Sequence[Given] = ()
) -> list[str]:
    """Label each configuration by the name that it was given, else by its levels of all factors.

    A name that several treatments share is followed by what they differ in. Two configurations
    have the same label if and only if they are of one treatment: see ``find_factors``.
    """
    factors = find_factors(configurations, choices, given)
    conditions = list_conditions(configurations, given)
    names = [str(levels.get("name", "")) for levels in given] or [""] * len(configurations)
    shown = label_levels(factors, len(configurations))
    for name in dict.fromkeys(filter(None, names)):
        same = [i for i, other in enumerate(names) if other == name]
        part = [replace(f, levels=tuple(f.levels[i] for i in same)) for f in factors]
        differ = label_levels([f for f in part if len(set(f.levels)) > 1], len(same))
        for i, label in zip(same, differ, strict=True):
            shown[i] = name if label == SINGLE else f"{name}, {label}"
    labels: dict[object, str] = {}
    for condition, label in zip(conditions, shown, strict=True):
        if condition not in labels:
            labels[condition] = _number(label, labels.values())
    return [labels[condition] for condition in conditions]


def label_levels(factors: Sequence[Factor], count: int) -> list[str]:
    """Label each of ``count`` runs by its level of every factor; the names of one suffice.

    Long labels leave out levels that follow from those of earlier factors.
    """
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
    """Describe a factor in words, with its unit: ``wait_s`` is ``wait [s]``."""
    words, unit = _split(name)
    return f"{words} [{unit}]" if unit else words


def _split(name: str) -> tuple[str, str]:
    start, _, end = name.rpartition("_")
    words = start if start and end in UNITS else name
    return words.replace("_", " ").replace(".", " "), UNITS[end] if words == start else ""


def _describe(factor: Factor, level: str, inside: bool) -> str:
    """Describe a level; a value of a part that a run does not have needs no word."""
    words, unit = _split(factor.name)
    if not level:
        return "" if inside else f"no {words}"
    return f"{words} {describe_level(level)}" + (f" {unit}" if unit else "")


def describe_level(level: str) -> str:
    """Describe a level in words, as the field writes it; a long one is cut."""
    text = OWN_NAMES.get(level, level.replace("_", " "))
    return text if len(text) <= LEVEL_LENGTH else text[: LEVEL_LENGTH - 3] + "..."


def _number(label: str, taken: Iterable[str]) -> str:
    """Append a number to a label that is taken."""
    namesakes = sum(known.partition(" #")[0] == label for known in taken)
    return f"{label} #{namesakes + 1}" if namesakes else label


def report_repeated(runs: Iterable[Record]) -> list[str]:
    """Report in one line the runs that repeat a seed, so that they are no replicates."""
    table = pd.DataFrame([(r.name, r.treatment, r.seed) for r in runs], columns=["run", "t", "s"])
    repeated = table.run[table.duplicated(["t", "s"])].tolist()
    if not repeated:
        return []
    shown = ", ".join(repeated[:3]) + (", ..." if len(repeated) > 3 else "")
    return [f"same treatment and seed as another run, so no replicates; leave out: {shown}"]
