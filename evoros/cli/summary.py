"""What runs and evaluations say at their end."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from evoros.session.figures import FIGURES
from evoros.storage.mission_log import STATUS


def summary(folder: Path) -> str:
    """A few lines from the run's own files: fitness, recorded and validated apart, and where."""
    status = json.loads((folder / STATUS).read_text())
    validated = status["best_validated_fitness"]
    lines = [
        f"best fitness      {status['best_fitness']:.3f} recorded"
        + ("" if validated is None else f", {validated:.3f} validated on fresh draws"),
        f"generations       {status['generations_done']}",
        _missions(status),
        f"champion          {folder / 'champion'}",
        f"run folder        {folder}",
    ]
    if (folder / FIGURES).is_dir():
        lines.insert(-1, f"figures           {folder / FIGURES}")
    if status["mean_loss"] is not None:
        lines.insert(1, _loss(status))
    return "\n".join(lines)


def evaluation(folder: Path) -> str:
    """The same of an evaluation."""
    status = json.loads((folder / STATUS).read_text())
    lines = [
        f"fitness           {status['best_fitness']:.3f} of the best, {status['mean_fitness']:.3f} "
        f"on average",
        f"designs           {status['designs']}",
        _missions(status),
        f"scores            {folder / 'designs.csv'}",
        f"folder            {folder}",
    ]
    return "\n".join(lines)


def _missions(status: Mapping[str, Any]) -> str:
    """How many, and at what pace."""
    wall, simulated = status["session_wall_s"], status["session_simulated_s"]
    pace = f", {simulated / wall:.0f} simulated s/s" if wall > 0 else ""
    return (
        f"missions          {status['missions']}, of which {status['session_missions']} now "
        f"({simulated:.0f} simulated s in {wall:.0f} s{pace})"
    )


def _loss(status: Mapping[str, Any]) -> str:
    """What the confirming simulator took from the fitness in the run's own."""
    best = "" if status["best_loss"] is None else f"{status['best_loss']:.3f} of the best, "
    mean = f"{status['mean_loss']:.3f} on average of {status['confirmed']} designs"
    return f"loss, confirmed   {best}{mean}"
