"""Matching of designs and conditions of runs and evaluations by content.

Folders may be moved and renamed, and design numbers have no meaning outside their run.
"""

from collections.abc import Hashable, Mapping
from typing import Any, TypeVar

import pandas as pd

from .records import EvaluationRecord, Record
from .tracks import name_robots

MISSION = (
    "robot",
    "world",
    "agents",
    "design.sensors",
    "failure",
    "controller",
    "simulator",
    "fitness",
)
"""Keys, or first parts of keys, that determine the score of a given design.

The worlds include the ``course``; the rest of ``design`` only limits which designs can evolve.
"""
POSE = ("x_m", "y_m", "z_m", "yaw_deg", "pitch_deg")
CONFIRMING = "confirmation.simulator"
Content = tuple[Hashable, ...]
Value = TypeVar("Value")


def select_conditions(record: Record) -> dict[str, Any]:
    """Select the values that determine a design's score; a confirming simulator counts."""
    values = apply_confirmation(record.values)
    return {
        key: value for key, value in values.items() if any(is_within(key, top) for top in MISSION)
    }


def apply_confirmation(entries: Mapping[str, Value]) -> dict[str, Value]:
    """Replace the simulator's entries (values or choices by key) by the confirming simulator's."""
    confirming = {
        key.removeprefix("confirmation."): entry
        for key, entry in entries.items()
        if is_within(key, CONFIRMING)
    }
    if not confirming:
        return dict(entries)
    return {k: v for k, v in entries.items() if not is_within(k, "simulator")} | confirming


def is_within(key: str, top: str) -> bool:
    """Return True if a dotted key is ``top`` or below it."""
    return key == top or key.startswith(f"{top}.")


def find_differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """List the keys whose values differ; a missing value equals null."""
    return [key for key in dict.fromkeys([*one, *other]) if one.get(key) != other.get(key)]


def list_differences(evaluation: EvaluationRecord, record: Record) -> list[str]:
    """List the keys by which the conditions of an evaluation and a run differ, except genes."""
    evolved = read_champion_genes(record)
    differences = find_differences(select_conditions(evaluation), select_conditions(record))
    return [key for key in differences if key not in evolved]


def identify_champion(record: Record) -> Content:
    """Return the content of a finished run's champion: its sensors and genes."""
    return _content(record.run.champion, read_champion_genes(record))


def read_champion_genes(record: Record) -> dict[str, float]:
    """Read the evolved values other than sensors of a finished run's champion, by key."""
    return _genes(record.run.genes)


def read_scores(evaluation: EvaluationRecord) -> pd.DataFrame:
    """Read the content and the scores of each design in a finished evaluation.

    ``fitness`` is the evaluation's fitness of the trials, usually their mean.
    """
    names = ["source", "design"]
    mounts, genes, scores = (
        table.assign(**{name: table[name].astype(str) for name in names})
        for table in (evaluation.mounts, evaluation.genes, evaluation.run.designs)
    )
    evolved = {key: _genes(rows) for key, rows in genes.groupby(names)}
    contents = {key: _content(rows, evolved.get(key, {})) for key, rows in mounts.groupby(names)}
    keys = zip(scores["source"], scores["design"], strict=True)
    scores["content"] = pd.Series([contents[key] for key in keys], scores.index, dtype=object)
    if "fitness" not in scores:
        scores["fitness"] = scores["fitness_mean"]
    return scores[["content", *names, "fitness", "fitness_sd", "trials"]]


def _content(mounts: pd.DataFrame, genes: Mapping[str, float]) -> Content:
    """Combine the sensors, in the order that failures refer to, and the genes, sorted by key."""
    placed = mounts[mounts["sensor"].notna()].assign(robot=name_robots)
    placed = placed.sort_values(["robot", "sensor"])
    poses = placed[list(POSE)].astype(float).itertuples(index=False, name=None)
    names = (placed[name].astype(str) for name in ("robot", "type", "link"))
    return tuple(zip(*names, poses, strict=True)), tuple(sorted(genes.items()))


def _genes(table: pd.DataFrame) -> dict[str, float]:
    rows = zip(name_robots(table), table["key"], table["value"], strict=True)
    return {f"agents.{robot}.{k}" if robot else str(k): float(v) for robot, k, v in rows}
