"""The same designs under the same draws in several configurations, each by ``evoros-evaluate``.

A series is a folder of that command. What is finished is not flown again; what was cut short is
resumed; so a study of many series can be killed at any time and goes on where it was.
"""

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from evoros.base.rng import generator
from evoros.config.compose import compose
from evoros.storage.tables import design_table

EVALUATE = Path(sys.executable).with_name("evoros-evaluate")
DESIGNS = "designs.csv"


@dataclass(frozen=True)
class Series:
    """A configuration: ``seed`` stands for one set of draws, which several series may share."""

    simulator: str  # how tables name it
    treatment: str
    seed: int
    overrides: tuple[str, ...]

    def path(self, study: Path) -> Path:
        """Its folder."""
        return study / f"{self.simulator}_{self.treatment}_{self.seed}"

    def finished(self, study: Path) -> bool:
        """Whether all of its missions are on disk."""
        status = self.path(study) / "status.json"
        return status.exists() and json.loads(status.read_text())["state"] == "finished"

    def fly(self, study: Path, workers: int) -> None:
        """All of its missions; the process ends as the command does if that fails."""
        if self.finished(study):
            return
        folder = self.path(study)
        arguments = [
            f"designs={study / DESIGNS}",
            f"hydra.run.dir={folder}",
            f"failure={self.treatment}",
            f"seed={self.seed}",
            *self.overrides,
        ]
        if (folder / "manifest.json").exists():
            arguments = [f"resume={folder}"]
        ended = subprocess.run([EVALUATE, *arguments, f"executor.workers={workers}"])
        if ended.returncode:
            sys.exit(ended.returncode)

    def missions(self, study: Path) -> pd.DataFrame:
        """A row for each mission, with the columns ``simulator``, ``treatment`` and ``draw``.

        ``draw`` names the random draws: a mission of another series with the same world and draw
        met the same ones.
        """
        table = pd.read_csv(self.path(study) / "missions.csv", dtype=str, keep_default_na=False)
        draw = table.trial.map(lambda trial: f"{self.seed}.{trial}")
        return table.assign(simulator=self.simulator, treatment=self.treatment, draw=draw)


def random_designs(study: Path, count: int) -> None:
    """The first designs of an endless sequence, in a file for ``evoros-evaluate``, once."""
    if (study / DESIGNS).exists():
        return
    space = compose([]).build().space
    rng = generator("0", "random_designs")
    designs = {number: space.decode(rng.random(space.size)) for number in range(count)}
    study.mkdir(parents=True, exist_ok=True)
    (study / DESIGNS).write_text(design_table(designs))
