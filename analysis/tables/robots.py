"""One robot of several: its rows in the tables of a champion, and its trajectory."""

import pandas as pd

from evoros.base.errors import InputError
from evoros.storage.tables import AGENT


def select_robot(table: pd.DataFrame, name: str = "") -> pd.DataFrame:
    """Select the rows of a robot in a table of a champion; the first one's name is empty."""
    return table[name_robots(table) == name]


def name_robots(table: pd.DataFrame) -> "pd.Series[str]":
    """Name the robot of each row of a table of a champion; the first one's name is empty."""
    if AGENT not in table:
        return pd.Series("", table.index, dtype=str)
    return table[AGENT].fillna("").astype(str)


def select_trajectory(trajectory: pd.DataFrame, name: str) -> pd.DataFrame:
    """Select the columns of another robot, without its name, and the time."""
    prefix = f"{name}."
    columns = [column for column in map(str, trajectory.columns) if column.startswith(prefix)]
    if not columns:
        raise InputError(
            f"the trajectory must have columns of the robot {name}, but has none; restore the file"
        )
    table = trajectory[["time_s", *columns]]
    return table.rename(columns=lambda column: str(column).removeprefix(prefix))
