"""How many missions a call should have, by how long the missions of other calls took."""

from dataclasses import dataclass

FIRST = 1
"""Missions in a call as long as nothing is known."""
GROWTH = 8
"""A call has at most so many times the missions of any call before it."""
MEMORY = 0.9
"""How much less a call counts than the one that ended after it."""


@dataclass
class Pace:
    """The time that missions of one scenario take in a worker; the newest calls count most."""

    missions: float = 0.0
    seconds: float = 0.0
    most: int = 0  # missions that one call has finished

    def note(self, finished: int, timed: int, seconds: float) -> None:
        """Learn from a call that finished missions, and how long the ``timed`` of them took."""
        self.missions = MEMORY * self.missions + timed
        self.seconds = MEMORY * self.seconds + seconds
        self.most = max(self.most, finished)

    def fit(self, seconds: float) -> int:
        """Return how many missions a worker begins within the time [s] of a call."""
        if not self.missions:
            return FIRST
        most = max(FIRST, GROWTH * self.most)
        return 1 + int(min(most - 1, seconds * self.missions / max(self.seconds, 1e-9)))
