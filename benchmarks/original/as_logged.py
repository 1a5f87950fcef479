"""Eq. 1 as the original runs came to count it: what most missions did after the turn at home.

The logs of the original runs, and the version of their controller from those days, show two
faults that no condition of a mission has (docs/original.md):

- At home, half way, the controller asked for a distance that was not known yet and ended with an
  error, unless it was late. From then on nothing avoided obstacles and no progress was reported:
  the mission stayed at 60 %.
- A mission of more than 300 s of wall time was broken off and flown again, until one ended in
  less; the longest one that any log has took 350 s of simulated time.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import POSITIVE, checked
from evoros.fitness.equation_one import NOTHING_DONE, equation_one
from evoros.mission.outcome import Outcome

HOME = 5  # waypoints of the first phase
AT_HOME = 0.6  # progress that was reported there


@dataclass(frozen=True)
@checked
class AsLogged:
    """Eq. 1; a mission that gets home goes on with the probability ``went_on`` of its world.

    Else its progress is 0.6. So it is where it goes on for longer than ``longest_s``: it would
    have been flown again, until it ended sooner. Whether it goes on is drawn from the bits of what
    the mission measured, so that the same mission always counts the same.
    """

    went_on: Sequence[float] = (0.0, 0.0, 0.0)  # in the order of the worlds
    # 350 s in the logs, in which about 10 s pass before the rover drives.
    longest_s: Annotated[float, POSITIVE] = 340.0

    def score(self, outcomes: Sequence[Outcome]) -> float:
        """Sum over the worlds."""
        return sum(map(self._mission, outcomes, self.went_on))

    def worst(self, outcomes: Sequence[Outcome]) -> float:
        """Nothing done in any world."""
        return len(outcomes) * NOTHING_DONE

    def _mission(self, outcome: Outcome, went_on: float) -> float:
        at_home = (1.0 + AT_HOME) ** 2
        if outcome.visited < HOME:
            return equation_one(outcome)
        goes_on = luck(outcome) < went_on and outcome.time_s <= self.longest_s
        return equation_one(outcome) if goes_on else at_home


def luck(outcome: Outcome) -> float:
    """A number from 0 to 1 that is as good as random, and the same for the same mission."""
    measured = repr((outcome.time_s, outcome.distance_m, outcome.least_waypoint_distances_m))
    return int.from_bytes(hashlib.sha256(measured.encode()).digest()[:8]) / 2.0**64
