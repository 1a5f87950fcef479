"""Which evaluation scored which design, and under which conditions: by content, not by name.

Folders may be moved and renamed, and a design's number says nothing outside of its run.
"""

from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any

import pandas as pd

from evoros.base.errors import InputError

if TYPE_CHECKING:
    from .records import Record, Scored

MISSION = ("robot", "world", "design.sensors", "failure", "controller", "simulator", "fitness")
"""The keys, or first parts of keys, on which the score of a given design depends. ``course`` is in
the worlds that refer to it; the rest of ``design`` says which designs there can be."""
POSE = ("x_m", "y_m", "z_m", "yaw_deg", "pitch_deg")
Content = tuple[Hashable, ...]


def conditions(record: "Record") -> dict[str, Any]:
    """The values on which the score of a given design depends; a run's, where it is confirmed."""
    values = dict(record.values)
    confirming = {
        key.removeprefix("confirmation."): value
        for key, value in values.items()
        if key.startswith("confirmation.simulator.")
    }
    if confirming:
        values = {k: v for k, v in values.items() if not k.startswith("simulator.")} | confirming
    return {
        key: value
        for key, value in values.items()
        if any(key == each or key.startswith(f"{each}.") for each in MISSION)
    }


def differing(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """The keys whose values are not the same; one that is missing is null."""
    return [key for key in dict.fromkeys([*one, *other]) if one.get(key) != other.get(key)]


def champion_content(record: "Record") -> Content:
    """What a finished run's champion is: its sensors, and its other values.

    Raises:
        InputError: a file is missing or damaged.
    """
    return _content(record.run.champion, champion_genes(record))


def champion_genes(record: "Record") -> dict[str, float]:
    """The other values of a finished run's champion, by key."""
    return _values(record.run.genes)


def scored_designs(scored: "Scored") -> pd.DataFrame:
    """A row for each design of a finished evaluation: what it is, and its scores.

    Columns ``content``, ``source``, ``design``, ``fitness_mean``, ``fitness_sd``, ``trials``.

    Raises:
        InputError: it is not finished, or damaged.
    """
    names = ["source", "design"]
    try:
        mounts, genes, scores = (
            table.assign(**{name: table[name].astype(str) for name in names})
            for table in (scored.given, scored.genes, scored.designs)
        )
        other = {key: _values(rows) for key, rows in genes.groupby(names)}
        contents = {key: _content(rows, other.get(key, {})) for key, rows in mounts.groupby(names)}
        keys = zip(scores["source"], scores["design"], strict=True)
        scores["content"] = pd.Series([contents[key] for key in keys], scores.index, dtype=object)
    except (LookupError, AttributeError, TypeError, ValueError) as error:
        said = " ".join(str(error).split())
        raise InputError(f"{scored.path}: its tables must be whole ({said})") from error
    return scores[["content", *names, "fitness_mean", "fitness_sd", "trials"]]


def _content(mounts: pd.DataFrame, values: Mapping[str, float]) -> Content:
    """Sensors in their order, which failures may refer to; values in that of their keys."""
    there = mounts[mounts["sensor"].notna()].sort_values("sensor")
    poses = there[list(POSE)].astype(float).itertuples(index=False, name=None)
    sensors = tuple(zip(there["type"].astype(str), there["link"].astype(str), poses, strict=True))
    return sensors, tuple(sorted(values.items()))


def _values(genes: pd.DataFrame) -> dict[str, float]:
    return {str(k): float(v) for k, v in zip(genes["key"], genes["value"], strict=True)}
