"""What a run says at its end."""

import json
from pathlib import Path

from evoros.record import STATUS


def summary(folder: Path) -> str:
    """A few lines from the run's own files: fitness, recorded and validated apart, and where."""
    status = json.loads((folder / STATUS).read_text())
    validated = status["best_validated_fitness"]
    wall, simulated = status["session_wall_s"], status["session_simulated_s"]
    pace = f", {simulated / wall:.0f} simulated s/s" if wall > 0 else ""
    lines = [
        f"best fitness      {status['best_fitness']:.3f} recorded"
        + ("" if validated is None else f", {validated:.3f} validated on fresh draws"),
        f"generations       {status['generations_done']}",
        f"missions          {status['missions']}, of which {status['session_missions']} now "
        f"({simulated:.0f} simulated s in {wall:.0f} s{pace})",
        f"champion          {folder / 'champion'}",
        f"run folder        {folder}",
    ]
    return "\n".join(lines)
