"""The quantities of missions that requirements are about."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields

from evoros.base.errors import InputError
from evoros.mission.outcome import NOT_RUN, Outcome, Outcomes

COMPLETION_TIME = "completion_time_s"
"""The time of a completed mission; infinite for another, whose ``time_s`` says nothing."""
COLUMNS = (
    *(field.name for field in fields(Outcome) if field.type in (bool, int, float)),
    COMPLETION_TIME,
)
BOUNDS: Mapping[str, tuple[float, float]] = {
    "completed": (0.0, 1.0),
    "progress": (0.0, 1.0),
    "avoiding": (0.0, 1.0),
}
"""Quantities with natural bounds."""


def read_quantity(outcomes: Outcomes, column: str, agents: Sequence[str]) -> float:
    """Return a quantity of a mission; NaN if the mission was not run.

    ``column`` is one of ``COLUMNS``, after the name of an agent and a dot if it is of that robot.
    What was not measured because it never happened, such as a first collision, is infinite.
    """
    name, _, of_robot = column.rpartition(".")
    outcome = outcomes[1 + agents.index(name) if name else 0]
    if outcome.ended in NOT_RUN:
        return math.nan
    if of_robot == COMPLETION_TIME:
        return outcome.time_s if outcome.completed else math.inf
    value = float(getattr(outcome, of_robot))
    return math.inf if math.isnan(value) else value


def require_column(key: str, column: str, agents: Sequence[str]) -> None:
    """Require that missions have a column.

    Raises:
        InputError: they have not; the message names those that they have.
    """
    name, _, of_robot = column.rpartition(".")
    if (name and name not in agents) or of_robot not in COLUMNS:
        known = ", ".join(COLUMNS) + (f"; of agents {', '.join(agents)}.COLUMN" if agents else "")
        raise InputError(
            f"{key}: must be a measure or one of {known}, not {column!r}; choose one of these"
        )
