"""Conditions that apply to some missions of an evaluation instead of the configured ones."""

from dataclasses import dataclass, field
from typing import Any

from evoros.failure.protocol import Case

FAILED_SENSOR, WORLD = "failed_sensor", "world"
PARTS = ("failure", "walkers", "simulator", "controller")
"""Fields of an experiment that a condition may replace."""


@dataclass(frozen=True)
class Condition:
    """A given case of failed sensors, or a part that replaces one of the experiment's parts.

    Without either, missions run under the evaluation's conditions.
    """

    case: Case | None = None  # failures that replace all others
    factor: str = ""  # one of PARTS
    name: str = ""  # name of the replacing part
    part: Any = field(default=None, compare=False, repr=False)

    @property
    def text(self) -> str:
        """The value in the column ``case`` of the missions; empty for ``OWN``."""
        if self.case is not None:
            return self.case.text
        return f"{self.factor}={self.name}" if self.factor else ""


OWN = Condition()
"""The conditions of the evaluation itself."""
