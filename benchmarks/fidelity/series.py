"""Evaluates the same designs under the same draws in several configurations.

A series is one evaluation by ``evoros evaluate`` in a folder of its own. A finished series is not
run again and an interrupted one is resumed. So a study of many series can be killed at any time and
continues where it stopped.
"""

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from evoros.base.rng import generator
from evoros.config.compose import compose
from evoros.storage.champion_files import design_table

EVOROS = Path(sys.executable).with_name("evoros")
DESIGNS = "designs.csv"


@dataclass(frozen=True)
class Series:
    """One configuration. Series with the same ``seed`` have the same draws."""

    simulator: str  # its name in tables
    treatment: str
    seed: int
    overrides: tuple[str, ...]

    def path(self, study: Path) -> Path:
        """The folder of the series."""
        return study / f"{self.simulator}_{self.treatment}_{self.seed}"

    def finished(self, study: Path) -> bool:
        """Whether all of its missions are on disk."""
        status = self.path(study) / "status.json"
        return status.exists() and json.loads(status.read_text())["state"] == "finished"

    def run(self, study: Path, workers: int) -> None:
        """Run all missions. If the command fails, this process exits with its status."""
        if self.finished(study):
            return
        folder = self.path(study)
        arguments = [
            "evaluate",
            f"designs={study / DESIGNS}",
            f"hydra.run.dir={folder}",
            f"failure={self.treatment}",
            f"seed={self.seed}",
            *self.overrides,
        ]
        if (folder / "manifest.json").exists():
            arguments = ["resume", str(folder)]
        command = subprocess.run([EVOROS, *arguments, f"executor.workers={workers}"])
        if command.returncode:
            sys.exit(command.returncode)

    def missions(self, study: Path) -> pd.DataFrame:
        """The missions, with the columns ``simulator``, ``treatment`` and ``draw``.

        Missions of several series with the same world and ``draw`` have the same random draws.
        """
        table = pd.read_csv(self.path(study) / "missions.csv", dtype=str, keep_default_na=False)
        draw = table.trial.map(lambda trial: f"{self.seed}.{trial}")
        return table.assign(simulator=self.simulator, treatment=self.treatment, draw=draw)


def random_designs(study: Path, count: int) -> None:
    """Write the first ``count`` random designs to a file, unless the study has one."""
    if (study / DESIGNS).exists():
        return
    space = compose([]).build().space
    rng = generator("0", "random_designs")
    designs = {design_id: space.decode(rng.random(space.size)) for design_id in range(count)}
    study.mkdir(parents=True, exist_ok=True)
    (study / DESIGNS).write_text(design_table(designs))
