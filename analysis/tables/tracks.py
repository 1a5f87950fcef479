"""The champion's first mission in each world, as a table: places, modes, failures."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext
from evoros.storage.reading import Run
from evoros.world.loading import load_world
from evoros.world.model import World

from .generations import select_bests

NONE = "none"
"""The mode in which no layer of the controller decided."""
COLUMNS = (
    "world",
    "time_s",
    "x_m",
    "y_m",
    "yaw_rad",
    "mode",
    "contact",
    "failed_sensors",
    "failed_by",
    "ended",
)


def read_track(run: Run, context: FigureContext, world: str) -> pd.DataFrame:
    """Read the champion's mission in a world: a row for each record, with ``COLUMNS``.

    ``mode`` is the name of the layer that decided. ``failed_sensors`` are the sensors, from 0,
    that failed since the previous record, and ``failed_by`` the effects, both separated by
    semicolons; ``ended`` is set in the last row alone. If the mission could not be run, the table
    is empty.

    Raises:
        InputError: a file is missing or damaged, or the mission is not in ``missions.csv``.
    """
    trajectory, mission = run.trajectory(world), find_champion_mission(run, world)
    names = np.array([NONE, *context.modes])
    modes = trajectory["mode"].to_numpy(int)
    if len(modes) and not 0 <= modes.min() <= modes.max() < len(names):
        raise InputError(
            f"{run.path / 'champion' / f'trajectory_{world}.csv'}: mode must be from 0 to "
            f"{len(names) - 1}, the modes of setting.json, not {modes.max()}; restore the files"
        )
    table = trajectory[["time_s", "x_m", "y_m", "yaw_rad", "contact"]].astype(float)
    table["world"], table["mode"] = world, names[modes]
    table["contact"] = table["contact"].astype(int)
    failed = _failures_by_row(mission, table["time_s"].to_numpy())
    for column, place in (("failed_sensors", 0), ("failed_by", 1)):
        cells = {row: ";".join(pair[place] for pair in pairs) for row, pairs in failed.items()}
        table[column] = [cells.get(row, "") for row in range(len(table))]
    table["ended"] = ["" for _ in table.index[1:]] + [mission["ended"] for _ in table.index[:1]]
    return table[list(COLUMNS)]


def find_champion_mission(run: Run, world: str) -> "pd.Series[str]":
    """Find the row of ``missions.csv`` whose trajectory is in ``champion``.

    It is the first mission in the world that counted for the fitness of the last generation's
    best design: in its confirmation if it was confirmed, else in its selection.

    Raises:
        InputError: the row is missing.
    """
    champion = int(select_bests(run.generations)["id"].iloc[-1])
    missions = run.missions
    candidates = missions[(missions["design"] == champion) & (missions["world"] == world)]
    confirmed = candidates[candidates["purpose"] == "confirmation"]
    scored = confirmed if len(confirmed) else candidates[candidates["purpose"] == "selection"]
    if scored.empty:
        raise InputError(
            f"{run.path / 'missions.csv'}: must contain the champion's mission (design "
            f"{champion} in {world}), but does not; restore the file"
        )
    return scored.sort_values("trial").iloc[0]


def load_champion_worlds(run: Run, context: FigureContext) -> Mapping[str, World]:
    """Load the worlds of the champion's missions from the run's folder, by name.

    Raises:
        InputError: a file is missing or damaged.
    """
    return {name: load_champion_world(run, context, name) for name in context.courses}


def load_champion_world(run: Run, context: FigureContext, name: str) -> World:
    """Load one world of the champion's missions.

    Raises:
        InputError: the file is missing or damaged.
    """
    path = run.path / "champion" / f"world_{name}.sdf"
    if not path.is_file():
        raise InputError(f"{path}: must exist, but is missing; resume the run, or restore the file")
    return load_world(str(path.resolve()), context.courses[name])


def list_failures(mission: "pd.Series[str]") -> list[tuple[int, float, str]]:
    """List sensor (from 0), time [s] and effect of each failure in a row of ``missions.csv``."""
    names = ("failed_sensors", "failed_at_s", "failed_by")
    failures = zip(*(_split(mission[name]) for name in names), strict=True)
    return [(int(float(sensor)), float(time), effect) for sensor, time, effect in failures]


def _failures_by_row(
    mission: "pd.Series[str]", times: np.ndarray
) -> dict[int, list[tuple[str, str]]]:
    """Group sensors and effects by the first row at or after the failure."""
    rows: dict[int, list[tuple[str, str]]] = {}
    for sensor, time, effect in list_failures(mission):
        row = min(int(np.searchsorted(times, time)), len(times) - 1)
        rows.setdefault(row, []).append((str(sensor), effect))
    return rows


def _split(value: object) -> list[str]:
    """Split the list in a cell; pandas reads a list of one number as a number."""
    return [] if pd.isna(value) else str(value).split(";")  # type: ignore[call-overload]
