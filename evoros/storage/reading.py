"""Reads the tables in run folders as pandas data frames."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from evoros.base.errors import InputError
from evoros.storage import layout
from evoros.storage.archives import open_run
from evoros.storage.layout import read_bytes, read_sealed
from evoros.storage.trajectory_files import trajectory_file
from evoros.storage.verification import list_tables, verify_file, verify_folder

FILES = {layout.CONFIG, layout.DIGESTS, layout.MANIFEST, layout.MISSIONS, layout.STATUS}
MISSION_NUMBERS = ("trial", "progress", "time_s")
RUN_NUMBERS = ("generation", "design", *MISSION_NUMBERS)
SCORE_NUMBERS = ("fitness_mean", "fitness_sd", "trials")
CANDIDATE_NUMBERS = ("generation", "id", "fitness", "validated_fitness")
SENSOR_NUMBERS = ("design", "sensor", "x_m", "y_m", "z_m", "yaw_deg", "pitch_deg")
RECORD_NUMBERS = ("time_s", "x_m", "y_m", "yaw_rad", "speed_mps", "mode", "visited", "contact")
"""Required columns with cells that are numbers or empty."""


@dataclass(frozen=True)
class Run:
    """The folder of a run or evaluation, finished or not; see ``docs/run_folder.md``."""

    path: Path

    @cached_property
    def manifest(self) -> dict[str, Any]:
        """The versions, the machine and the digests of the run's inputs."""
        return read_sealed(self.path, layout.MANIFEST)

    @cached_property
    def status(self) -> dict[str, Any]:
        """The progress of the run; its ``state`` is running, finished or stopped."""
        return read_sealed(self.path, layout.STATUS)

    @property
    def evaluates(self) -> bool:
        """True for an evaluation, which has ``designs`` but no generations or champion."""
        return layout.evaluates(self.path)

    @cached_property
    def missions(self) -> pd.DataFrame:
        """The finished missions, one per row, sorted by generation, design, world and trial.

        The table of an evaluation has columns ``source`` and ``design``, and is in the order of the
        file.
        """
        if self.evaluates:
            return read_table(self.path / layout.MISSIONS, MISSION_NUMBERS)
        frame = read_table(self.path / layout.MISSIONS, RUN_NUMBERS)
        return frame.sort_values(["generation", "design", "world", "trial"], ignore_index=True)

    @cached_property
    def generations(self) -> pd.DataFrame:
        """The candidates of all finished generations, one per row; may be empty."""
        self._require(evaluation=False)
        frames = [read_table(file, CANDIDATE_NUMBERS) for file in list_tables(self.path)]
        return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()

    def champion_file(self, name: str, agent: str = "") -> Path:
        """Return the path of a file of the champion, or of one of its agents."""
        folder = self.path / "champion"
        return (folder / "agents" / agent if agent else folder) / name

    @cached_property
    def champion(self) -> pd.DataFrame:
        """The sensors of the champion, one per row; requires a finished run."""
        self._require(evaluation=False)
        return read_table(self.champion_file("design.csv"), SENSOR_NUMBERS)

    @cached_property
    def genes(self) -> pd.DataFrame:
        """The champion's evolved values except mounts, one per row; requires a finished run."""
        self._require(evaluation=False)
        return read_table(self.champion_file("genes.csv"), ("value",))

    @cached_property
    def designs(self) -> pd.DataFrame:
        """The designs of a finished evaluation with scores, one per row."""
        self._require(evaluation=True)
        return read_table(self.path / layout.SCORES, SCORE_NUMBERS)

    def _require(self, evaluation: bool) -> None:
        if self.evaluates != evaluation:
            kinds = ("a run", "missions, generations, champion and genes")
            other = ("an evaluation", "missions and designs")
            wanted, (found, tables) = (other, kinds) if evaluation else (kinds, other)
            raise InputError(
                f"{self.path}: {found}, but only {wanted[0]} has this table; read one of its "
                f"tables: {tables}"
            )

    def trajectory(self, world: str) -> pd.DataFrame:
        """Read the trajectory of the champion's first mission in a world, if stored."""
        self._require(evaluation=False)
        self.require_trajectories()
        return self._read_trajectory(f"champion/trajectory_{world}.csv")

    def require_trajectories(self, of_others: bool = False) -> None:
        """Raise an error unless the champion's or, if ``of_others``, all trajectories are kept."""
        recorded = self.manifest.get("record")
        if recorded == "none" or (of_others and recorded == "champion"):
            kind, fix = (" of all missions", "all") if of_others else ("", "champion")
            raise InputError(
                f"{self.path}: no trajectories{kind} (record={recorded}); start a run with "
                f"record={fix}"
            )

    def mission_trajectory(
        self, generation: int, design: int, world: str, trial: int
    ) -> pd.DataFrame:
        """Read the stored trajectory of a mission; raise an InputError if there is none."""
        self.require_trajectories(of_others=True)
        file = trajectory_file((generation, design, world, trial))
        if self.manifest.get("record") != "all" and not (self.path / file).is_file():
            raise InputError(
                f"{self.path / file}: not found, because the run keeps only the first missions of "
                "its best designs (record=champions); choose another mission, or run with "
                "record=all"
            )
        return self._read_trajectory(str(file))

    def _read_trajectory(self, name: str) -> pd.DataFrame:
        verify_file(self.path, name)
        return read_table(self.path / name, RECORD_NUMBERS)


def load_run(folder: str | Path) -> Run:
    """Return the run or evaluation in a folder or archive, finished or not.

    The run's code is not executed. ``study.zip/NAME`` names one of several runs in an archive. A
    missing or damaged run raises an InputError.
    """
    path = open_run(folder)
    missing = sorted(name for name in FILES if not (path / name).is_file())
    if missing:
        raise InputError(
            f"{path}: not a complete run folder ({', '.join(missing)} not found); "
            f"give the path that evoros printed as the run folder, or resume the run"
        )
    verify_folder(path)
    return Run(path)


def read_table(path: Path, numbers: Sequence[str]) -> pd.DataFrame:
    """Read a CSV file except an incomplete last row; columns ``numbers`` are numeric."""
    try:
        complete, newline, _ = read_bytes(path).decode().rpartition("\n")
        frame = pd.read_csv(io.StringIO(complete + newline))
    except ValueError as error:
        raise InputError(f"{path}: cannot be read ({error}); restore the file") from error
    for name in numbers:
        if name not in frame.columns:
            raise InputError(
                f"{path}: line 1: no column {name}, only "
                f"{', '.join(map(str, frame.columns))}; restore the file"
            )
        if frame[name].dtype.kind in "iuf":
            continue
        values = pd.to_numeric(frame[name], errors="coerce")
        invalid = frame[name].notna() & values.isna()
        if invalid.any():
            line, value = int(invalid.to_numpy().argmax()) + 2, frame.loc[invalid, name].iloc[0]
            raise InputError(
                f"{path}: line {line}: {name} must be a number, not {value!r}; restore the file"
            )
        frame[name] = values
    return frame


def read_worst_cases(folder: Path) -> pd.DataFrame | None:
    """Read the failure cases tried in an evaluation; None if it searched for none."""
    path = folder / layout.WORST_CASES
    if not path.is_file():
        return None
    table = read_table(path, ("number", "failed", "trials", "completed", "rate", "low", "high"))
    return table.astype({"source": str, "design": str})


def read_overrides(folder: Path) -> Sequence[str]:
    """Return the overrides with which the evaluation in a folder was started."""
    overrides: Sequence[str] = layout.read_json(folder / layout.MANIFEST).get(layout.OVERRIDES, ())
    return overrides


class ScoredDesigns(pd.DataFrame):
    """A table of designs, one per row; ``missions`` is the table of scored missions."""

    _metadata = ["missions"]  # noqa: RUF012 - pandas requires this list
    missions: pd.DataFrame
