"""The champion's first mission in each world, as a table: where, in which mode, what failed."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext
from evoros.storage.reading import Run
from evoros.world.loading import load_world
from evoros.world.model import World

from ..figures.fitness import bests

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


def track(run: Run, setting: FigureContext, world: str) -> pd.DataFrame:
    """A row for each record of the mission, with the columns ``COLUMNS``.

    ``mode`` is the name of the layer that decided. ``failed_sensors`` are those that have failed
    since the record before, from 0, ``failed_by`` the effects, both separated by semicolons and
    empty elsewhere. ``ended`` stands in the last row alone. Without rows: it was not flown.

    Raises:
        InputError: a file is missing or damaged, or the table of missions lacks the mission.
    """
    trajectory, mission = run.trajectory(world), champions_mission(run, world)
    names = np.array([NONE, *setting.modes])
    modes = trajectory["mode"].to_numpy(int)
    if len(modes) and not 0 <= modes.min() <= modes.max() < len(names):
        raise InputError(
            f"{run.path / 'champion' / f'trajectory_{world}.csv'}: mode must be from 0 to "
            f"{len(names) - 1}, as setting.json has them, not {modes.max()}; restore the files"
        )
    table = trajectory[["time_s", "x_m", "y_m", "yaw_rad", "contact"]].astype(float)
    table["world"], table["mode"] = world, names[modes]
    table["contact"] = table["contact"].astype(int)
    failed = _failed(mission, table["time_s"].to_numpy())
    for column, of in (("failed_sensors", 0), ("failed_by", 1)):
        cells = {row: ";".join(each[of] for each in those) for row, those in failed.items()}
        table[column] = [cells.get(row, "") for row in range(len(table))]
    table["ended"] = ["" for _ in table.index[1:]] + [mission["ended"] for _ in table.index[:1]]
    return table[list(COLUMNS)]


def champions_mission(run: Run, world: str) -> "pd.Series[str]":
    """The row of ``missions.csv`` of which ``champion`` has the trajectory.

    It is the first in the world that gave the best design of the last generation its fitness: of
    its selection, or of its confirmation where it was confirmed.

    Raises:
        InputError: there is no such row.
    """
    champion = int(bests(run.generations)["id"].iloc[-1])
    missions = run.missions
    own = missions[(missions["design"] == champion) & (missions["world"] == world)]
    confirmed = own[own["purpose"] == "confirmation"]
    chosen = confirmed if len(confirmed) else own[own["purpose"] == "selection"]
    if chosen.empty:
        raise InputError(
            f"{run.path / 'missions.csv'}: must have the champion's mission (design "
            f"{champion} in {world}), and has not; restore the file"
        )
    return chosen.sort_values("trial").iloc[0]


def champions_worlds(run: Run, setting: FigureContext) -> Mapping[str, World]:
    """The worlds of these missions, as the run has kept them, by name.

    Raises:
        InputError: a file is missing or damaged.
    """
    return {name: champions_world(run, setting, name) for name in setting.courses}


def champions_world(run: Run, setting: FigureContext, name: str) -> World:
    """One of them.

    Raises:
        InputError: its file is missing or damaged.
    """
    path = run.path / "champion" / f"world_{name}.sdf"
    if not path.is_file():
        raise InputError(f"{path}: must be there, and is missing; resume the run, or restore it")
    return load_world(str(path.resolve()), setting.courses[name])


def failures(mission: "pd.Series[str]") -> list[tuple[int, float, str]]:
    """Sensor, from 0, time [s] and effect of each failure in a row of ``missions.csv``."""
    names = ("failed_sensors", "failed_at_s", "failed_by")
    each = zip(*(_cells(mission[name]) for name in names), strict=True)
    return [(int(float(sensor)), float(at), effect) for sensor, at, effect in each]


def _failed(mission: "pd.Series[str]", times: np.ndarray) -> dict[int, list[tuple[str, str]]]:
    """Sensors and effects by the row of the first record at or after the failure."""
    found: dict[int, list[tuple[str, str]]] = {}
    for sensor, at, effect in failures(mission):
        row = min(int(np.searchsorted(times, at)), len(times) - 1)
        found.setdefault(row, []).append((str(sensor), effect))
    return found


def _cells(value: object) -> list[str]:
    """The items of a list in a cell; pandas has read a single number as one."""
    return [] if pd.isna(value) else str(value).split(";")  # type: ignore[call-overload]
