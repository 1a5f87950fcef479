"""One robot of several: its rows in the tables of a champion, its context, its trajectory."""

from typing import TYPE_CHECKING

import pandas as pd

from evoros.base.errors import InputError
from evoros.storage.figure_context import FigureContext
from evoros.storage.tables import AGENT

if TYPE_CHECKING:
    from .records import Record


def select_robot(table: pd.DataFrame, name: str = "") -> pd.DataFrame:
    """Select the rows of a robot in a table of a champion; the first one's name is empty."""
    return table[name_robots(table) == name]


def name_robots(table: pd.DataFrame) -> "pd.Series[str]":
    """Name the robot of each row of a table of a champion; the first one's name is empty."""
    if AGENT not in table:
        return pd.Series("", table.index, dtype=str)
    return table[AGENT].fillna("").astype(str)


def list_designed(record: "Record") -> list[str]:
    """List the other robots that have a design of their own."""
    return [
        name
        for name in record.context.agents
        if any(key.startswith(f"agents.{name}.design.") for key in record.values)
    ]


def find_designed(record: "Record", name: str) -> str:
    """Return the name of the robot whose design a robot has: its own, or the first one's."""
    return name if name in list_designed(record) else ""


def find_context(context: FigureContext, name: str = "") -> FigureContext:
    """Find the context of a robot; the first one's name is empty.

    Raises:
        InputError: there is no such robot.
    """
    if name and name not in context.agents:
        raise InputError(
            f"setting.json: agents must have {name!r}, a robot of the other tables, but has "
            f"{', '.join(context.agents) or 'none'}; restore the files"
        )
    return context.agents[name] if name else context


def select_trajectory(trajectory: pd.DataFrame, name: str) -> pd.DataFrame:
    """Select the columns of another robot, without its name, and the time.

    Raises:
        InputError: it has none.
    """
    prefix = f"{name}."
    own = [column for column in map(str, trajectory.columns) if column.startswith(prefix)]
    if not own:
        raise InputError(
            f"the trajectory must have columns of the robot {name}, but has none; restore the file"
        )
    table = trajectory[["time_s", *own]]
    return table.rename(columns=lambda column: str(column).removeprefix(prefix))
