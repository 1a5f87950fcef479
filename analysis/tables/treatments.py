"""Labels for what the runs of a study differ in."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

IGNORED = ("seed", "executor", "figures", "record")
"""Keys, or first parts of keys, in which replicates of one treatment may differ."""
TARGET = "_target_"
SINGLE = "all runs"
"""The label if there is one treatment."""
LABEL_LENGTH = 40  # characters
Values = Mapping[str, Any]
"""The values of a configuration by dotted key."""
Choices = Mapping[str, str]
"""The choice of a group by the dotted key of the part that it configures."""


def read_choices(recorded: object) -> dict[str, str]:
    """Convert the ``choices`` of ``manifest.json`` from groups to the keys of their parts.

    ``controller/navigation`` is at the key ``controller.navigation``, ``filter@failure.effect`` at
    ``failure.effect``. A group without a choice is dropped.
    """
    groups = recorded if isinstance(recorded, dict) else {}
    return {
        str(group).rpartition("@")[2].replace("/", "."): choice
        for group, choice in groups.items()
        if isinstance(choice, str)
    }


def label_treatments(
    configurations: Sequence[Values], choices: Sequence[Choices] = ()
) -> list[str]:
    """Label each configuration by what distinguishes its treatment from the others.

    A part of another class is named by its choice (see ``name_part``), a set of other worlds by
    the names of the worlds, and each unusual value is given as ``key=value``. ``choices`` belong
    to the configurations, in the same order.
    """
    compared = [
        {key: value for key, value in values.items() if key.split(".")[0] not in IGNORED}
        for values in configurations
    ]
    keys = list(dict.fromkeys(key for values in compared for key in values))
    differing = [k for k in keys if any(_get(v, k) != _get(compared[0], k) for v in compared)]
    conditions = [tuple(repr(_get(values, key)) for key in differing) for values in compared]
    usual = [Counter(column).most_common(1)[0][0] for column in zip(*conditions, strict=True)]
    labels: dict[tuple[str, ...], str] = {}
    chosen = choices or [{}] * len(compared)
    for condition, values, own_choices in zip(conditions, compared, chosen, strict=True):
        if condition not in labels:
            triples = zip(differing, condition, usual, strict=True)
            unusual = [key for key, value, most_common in triples if value != most_common]
            shown = (_label(values, own_choices, differing, k) for k in (unusual, differing))
            labels[condition] = _number(next(filter(None, shown), SINGLE), labels.values())
    return [labels[condition] for condition in conditions]


def _number(label: str, taken: Iterable[str]) -> str:
    """Append a number to a label that is taken."""
    namesakes = sum(known.partition(" #")[0] == label for known in taken)
    return f"{label} #{namesakes + 1}" if namesakes else label


def name_part(key: str, values: Values, choices: Choices) -> str:
    """Name the part at a dotted key by the choice of its group, else by its class."""
    return choices.get(key) or str(values.get(f"{key}.{TARGET}", "")).rpartition(".")[2]


def _get(values: Values, key: str) -> Any:
    return values.get(key, "absent")


def _label(values: Values, choices: Choices, differing: Sequence[str], shown: Sequence[str]) -> str:
    """Join the names of the parts and worlds that differ, and the values to be shown."""
    parts = [key.removesuffix(TARGET) for key in differing if key.endswith(TARGET)]
    outer = [part for part in parts if not any(part.startswith(p) and part != p for p in parts)]
    pieces = [
        name_part(part.removesuffix("."), values, choices)
        for part in outer
        if part + TARGET in values
    ]
    if any(key.startswith("world.") for key in differing):
        worlds = dict.fromkeys(key.split(".")[1] for key in values if key.startswith("world."))
        pieces.append("+".join(worlds))
    covered = (*outer, "world.")
    loose = [key for key in shown if key in values and not key.startswith(covered)]
    pieces += [f"{key.rpartition('.')[2]}={_shorten(values[key])}" for key in loose]
    return _join(pieces)


def _join(pieces: Sequence[str]) -> str:
    """Join the first pieces, as many as fit into a label."""
    fitting: list[str] = []
    for piece in pieces:
        if fitting and len(", ".join((*fitting, piece))) > LABEL_LENGTH:
            return ", ".join((*fitting, "..."))
        fitting.append(piece)
    return ", ".join(fitting)


def _shorten(value: Any) -> str:
    text = str(value).lower() if isinstance(value, bool) else str(value)
    return text if len(text) <= LABEL_LENGTH // 2 else text[: LABEL_LENGTH // 2 - 3] + "..."


def report_repeated(runs: Iterable[tuple[str, str, int]]) -> list[str]:
    """Report, in one line, the runs (name, treatment, seed) that repeat another run.

    Runs with the same configuration and seed are identical, so that they are no replicates.
    """
    names: dict[tuple[str, int], list[str]] = {}
    for name, treatment, seed in runs:
        names.setdefault((treatment, seed), []).append(name)
    repeated = [name for same in names.values() for name in same[1:]]
    if not repeated:
        return []
    shown = ", ".join(repeated[:3]) + (", ..." if len(repeated) > 3 else "")
    return [f"same treatment and seed as another run, so no replicates; leave out: {shown}"]
