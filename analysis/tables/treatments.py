"""What the runs of a study differ in, as labels for figures."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

IGNORED = ("seed", "executor", "figures")
"""Keys, or first parts of keys, that make no treatment: replicates and where they were computed."""
TARGET = "_target_"
ALONE = "all runs"
"""The label where there is one treatment."""
LONGEST = 40
"""Characters of a label."""


def labels(each: Sequence[Mapping[str, Any]]) -> list[str]:
    """For each of some configurations (values by dotted key) what tells its treatment from others.

    A part that is of another class is named by its module (``random`` of
    ``evoros.failure.random.RandomFailure``), a set of other worlds by their names, and whatever is
    not as in most of them as ``key=value``.
    """
    bare = [{k: v for k, v in values.items() if k.split(".")[0] not in IGNORED} for values in each]
    keys = list(dict.fromkeys(key for values in bare for key in values))
    differing = [key for key in keys if any(_get(v, key) != _get(bare[0], key) for v in bare)]
    conditions = [tuple(repr(_get(values, key)) for key in differing) for values in bare]
    usual = [Counter(column).most_common(1)[0][0] for column in zip(*conditions, strict=True)]
    names: dict[tuple[str, ...], str] = {}
    for condition, values in zip(conditions, bare, strict=True):
        if condition not in names:
            triples = zip(differing, condition, usual, strict=True)
            odd = [key for key, value, most in triples if value != most]
            name = _label(values, differing, odd) or _label(values, differing, differing) or ALONE
            again = sum(known.partition(" #")[0] == name for known in names.values())
            names[condition] = f"{name} #{again + 1}" if again else name
    return [names[condition] for condition in conditions]


def part_name(target: Any) -> str:
    """The short name of the class of a part: that of its module, as its YAML has it."""
    parts = str(target).split(".")
    return parts[-2] if len(parts) > 1 else parts[-1]


def _get(values: Mapping[str, Any], key: str) -> Any:
    return values.get(key, "absent")


def _label(values: Mapping[str, Any], differing: Sequence[str], shown: Sequence[str]) -> str:
    """A piece for each class or set of worlds that differs, and for each value to be shown."""
    classes = [key.removesuffix(TARGET) for key in differing if key.endswith(TARGET)]
    parts = [one for one in classes if not any(one.startswith(c) and one != c for c in classes)]
    pieces = [part_name(values[part + TARGET]) for part in parts if part + TARGET in values]
    if any(key.startswith("world.") for key in differing):
        worlds = dict.fromkeys(key.split(".")[1] for key in values if key.startswith("world."))
        pieces.append("+".join(worlds))
    covered = (*parts, "world.")
    rest = [key for key in shown if key in values and not key.startswith(covered)]
    pieces += [f"{key.rpartition('.')[2]}={_short(values[key])}" for key in rest]
    return _cut(pieces)


def _cut(pieces: Sequence[str]) -> str:
    kept: list[str] = []
    for piece in pieces:
        if kept and len(", ".join((*kept, piece))) > LONGEST:
            return ", ".join((*kept, "..."))
        kept.append(piece)
    return ", ".join(kept)


def _short(value: Any) -> str:
    text = str(value).lower() if isinstance(value, bool) else str(value)
    return text if len(text) <= LONGEST // 2 else text[: LONGEST // 2 - 3] + "..."


def repeated(runs: Iterable[tuple[str, str, int]]) -> list[str]:
    """A line where some (run, treatment, seed) have the treatment and the seed of another.

    The same configuration with the same seed gives the same run: it would count twice.
    """
    named: dict[tuple[str, int], list[str]] = {}
    for name, treatment, seed in runs:
        named.setdefault((treatment, seed), []).append(name)
    again = [name for names in named.values() for name in names[1:]]
    if not again:
        return []
    few = ", ".join(again[:3]) + (", ..." if len(again) > 3 else "")
    return [f"of the treatment and seed of another run, so no replicates; leave them out: {few}"]
