"""The protocol of what keeps the outcomes of missions."""

from collections.abc import Sequence
from typing import Protocol

from evoros.mission.mission import Mission
from evoros.mission.outcome import Outcomes

MissionResult = tuple[Mission, Outcomes]


class MissionRecord(Protocol):
    """Keeps the outcomes of missions: the journal of a run, or the folder of an evaluation."""

    def has(self, mission: Mission) -> bool:
        """Whether the mission has been recorded.

        Raises:
            InputError: it was recorded under other draws.
        """
        ...

    def record(self, results: Sequence[MissionResult]) -> None:
        """Record finished missions."""
        ...

    def keep_log(self, mission: Mission, log: str) -> None:
        """Keep the prints of the controller of a lost mission."""
        ...
