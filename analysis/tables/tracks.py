"""A champion's first mission in each world, and the tracks of single robots."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.mission.mission import MissionKey
from evoros.mission.plan import CONFIRMATION, EVALUATION, SELECTION
from evoros.storage.figure_context import FigureContext
from evoros.storage.reading import Run
from evoros.storage.tables import AGENT
from evoros.storage.trajectory_files import trajectory_file, world_file
from evoros.storage.verification import verify_world
from evoros.terminal.log import withhold_messages
from evoros.world.course import Course
from evoros.world.loading import load_world
from evoros.world.model import World

NONE = "none"  # mode while no layer of the controller has decided
COLUMNS = (
    *("world", "time_s", "x_m", "y_m", "yaw_rad", "mode", "phase", "contact"),
    *("failed_sensors", "failed_by", "ended"),
)
PARTS = ("failed_parts", "parts_failed_by")  # columns present if parts other than sensors can fail
TOUCHED = "touched_sensors"  # column present if the robot has bumpers: bumpers touched
ESTIMATE = ("estimated_x_m", "estimated_y_m", "estimated_yaw_rad")  # columns of the estimated pose


def select_track(tracks: pd.DataFrame, world: str, agent: str = "") -> pd.DataFrame:
    """Select the track of a robot in a world."""
    chosen = (tracks["world"] == world) & (name_robots(tracks) == agent)
    return tracks[chosen].reset_index(drop=True)


def read_track(
    run: Run, context: FigureContext, world: str, design: int | None = None
) -> pd.DataFrame:
    """Read a robot's track in a world, one row per sample, with ``COLUMNS`` and other columns.

    It ends with the robot's mission, empty if none could be run; see ``read_mission``.
    """
    mission, trajectory = read_mission(run, world, design)
    ended = float(mission["time_s"]) + 1e-6
    trajectory = trajectory[trajectory["time_s"] <= ended].reset_index(drop=True)
    names = np.array([NONE, *context.modes])
    modes = trajectory["mode"].to_numpy(int)
    if len(modes) and not 0 <= modes.min() <= modes.max() < len(names):
        name = f"champion/trajectory_{world}.csv"
        file = run.path / (name if design is None else trajectory_file(find_key(mission)))
        raise InputError(
            f"{file}: mode must be from 0 to "
            f"{len(names) - 1} (the modes in setting.json), not {modes.max()}; restore the files"
        )
    table = trajectory[["time_s", "x_m", "y_m", "yaw_rad", "contact"]].astype(float)
    table["world"], table["mode"] = world, names[modes]
    table["contact"] = table["contact"].astype(int)
    goals = len(context.courses[world].first_phase) - 1
    table["phase"] = np.where(trajectory["visited"].to_numpy(int) < goals, 1, 2)
    times = table["time_s"].to_numpy()
    table[["failed_sensors", "failed_by"]] = _place(list_failures(mission), times)
    parts = [*PARTS] if PARTS[0] in mission else []
    if parts:
        table[parts] = _place(list_part_failures(mission), times)
    table["ended"] = ["" for _ in table.index[1:]] + [mission["ended"] for _ in table.index[:1]]
    estimate = [name for name in ESTIMATE if name in trajectory]
    table[estimate] = trajectory[estimate].astype(float)
    matches = [re.fullmatch(r"touch_(\d+)", str(name)) for name in trajectory]
    bumpers = {int(match[1]): match[0] for match in matches if match}
    if bumpers:
        closed = trajectory[[*bumpers.values()]].to_numpy(float) > 0.0
        begins = closed & ~np.vstack([np.zeros((1, len(bumpers)), dtype=bool), closed[:-1]])
        sensors = np.array([*map(str, bumpers)])
        table[TOUCHED] = [";".join(sensors[row]) for row in begins]
    return table[[*COLUMNS, *parts, *estimate, *([TOUCHED] if bumpers else [])]]


def read_mission(
    run: Run, world: str, design: int | None = None
) -> tuple["pd.Series[str]", pd.DataFrame]:
    """Read the row and trajectory of the first mission by the champion or a stored design."""
    if design is None:
        return find_champion_mission(run, world), run.trajectory(world)
    row = find_first_mission(run, design, world)
    return row, run.mission_trajectory(*find_key(row))


def find_key(row: "pd.Series[str]") -> MissionKey:
    """Return the key of a mission from its row in ``missions.csv``."""
    return int(row["generation"]), int(row["design"]), str(row["world"]), int(row["trial"])


def find_champion_mission(run: Run, world: str) -> "pd.Series[str]":
    """Return the row of ``missions.csv`` that belongs to the trajectory in ``champion``."""
    return find_first_mission(run, int(run.champion["design"].iloc[0]), world)


def find_first_mission(run: Run, design: int, world: str) -> "pd.Series[str]":
    """Return a design's first mission in a world, preferably from the confirmation."""
    missions = run.missions
    candidates = missions[(missions["design"] == design) & (missions["world"] == world)]
    confirmed = candidates[candidates["purpose"] == CONFIRMATION]
    scored = candidates[candidates["purpose"].isin((SELECTION, EVALUATION))]
    scored = confirmed if len(confirmed) else scored
    if scored.empty:
        raise InputError(
            f"{run.path / 'missions.csv'}: no mission of design {design} in {world} was found; "
            f"restore the file"
        )
    return scored.sort_values(["generation", "trial"]).iloc[0]


def load_champion_worlds(run: Run, context: FigureContext) -> Mapping[str, World]:
    """Load the worlds of the champion's missions from the run folder, by name."""
    return {name: load_champion_world(run, context, name) for name in context.courses}


def load_champion_world(run: Run, context: FigureContext, name: str) -> World:
    """Load a world of the champion's missions."""
    return _load_recorded(run.champion_file(f"world_{name}.sdf"), context.courses[name])


def load_mission_world(run: Run, context: FigureContext, row: "pd.Series[str]") -> World:
    """Load the world of a stored mission, which may have been generated for this mission."""
    return _load_recorded(find_mission_world(run, row), context.courses[str(row["world"])])


def _load_recorded(path: Path, course: Course) -> World:
    if not path.is_file():
        raise InputError(f"{path}: not found; resume the run, or restore the file")
    verify_world(path)
    with withhold_messages():
        return load_world(str(path.resolve()), course)


def find_mission_world(run: Run, row: "pd.Series[str]") -> Path:
    """Return the path of a mission's world file."""
    world, draws = str(row["world"]), str(row["draws"])
    separate, shared = (run.path / world_file(world, key) for key in (draws, None))
    return separate if separate.is_file() else shared


def list_failures(mission: "pd.Series[str]") -> list[tuple[int, float, str]]:
    """List the sensor (from 0), onset [s] and effect of each failure in a mission's row."""
    names = ("failed_sensors", "failed_at_s", "failed_by")
    failures = zip(*(split_cell(mission[name]) for name in names), strict=True)
    return [(int(float(sensor)), float(time), effect) for sensor, time, effect in failures]


def list_part_failures(mission: "pd.Series[str]") -> list[tuple[str, float, str]]:
    """List the part, onset [s] and effect of each failure, except sensor failures."""
    names = ("failed_parts", "parts_failed_at_s", "parts_failed_by")
    if names[0] not in mission:
        return []
    failures = zip(*(split_cell(mission[name]) for name in names), strict=True)
    return [(part, float(time), effect) for part, time, effect in failures]


def has_failed(missions: pd.DataFrame) -> "pd.Series[bool]":
    """Return a mask of the missions in which any part failed."""
    failed = missions["failed_sensors"].notna()
    return failed | missions["failed_parts"].notna() if "failed_parts" in missions else failed


def _place(failures: Sequence[tuple[object, float, str]], times: Array) -> pd.DataFrame:
    cells = pd.DataFrame("", range(len(times)), ["failed", "by"], dtype=str)
    table = pd.DataFrame(failures, columns=["failed", "time", "by"])
    rows = np.searchsorted(times, table.pop("time")).clip(max=len(times) - 1)
    joined = table.astype(str).groupby(rows).agg(";".join)
    cells.loc[joined.index] = joined
    return cells


def split_cell(value: object) -> list[str]:
    """Split the list in a table cell; pandas reads a list of one item as a number."""
    return [] if pd.isna(value) else str(value).split(";")  # type: ignore[call-overload]


def select_robot(table: pd.DataFrame, name: str = "") -> pd.DataFrame:
    """Select the rows of a robot in a champion's table; the first robot has an empty name."""
    return table[name_robots(table) == name]


def name_robots(table: pd.DataFrame) -> "pd.Series[str]":
    """Return the robot in each row of a champion's table; empty for the first robot."""
    if AGENT not in table:
        return pd.Series("", table.index, dtype=str)
    return table[AGENT].fillna("").astype(str)


def select_trajectory(trajectory: pd.DataFrame, name: str) -> pd.DataFrame:
    """Select the time and the columns of an agent, without the agent's prefix."""
    prefix = f"{name}."
    columns = [column for column in map(str, trajectory.columns) if column.startswith(prefix)]
    if not columns:
        raise InputError(f"the trajectory has no columns for robot {name}; restore the file")
    table = trajectory[["time_s", *columns]]
    return table.rename(columns=lambda column: str(column).removeprefix(prefix))
