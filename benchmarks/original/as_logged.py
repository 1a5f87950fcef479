"""Eq. 1 as the original runs counted it, where most missions ended at home, half way.

The logs of the original runs, and their controller, show two faults that are not conditions of a
mission (docs/original.md):

- At home, the controller used a distance that was not known yet and ended with an error, unless it
  was late. From then on nothing avoided obstacles or reported progress, and the mission stayed at
  60 %.
- A mission of more than 300 s of wall time was aborted and run again until one took less. The
  longest mission in the logs took 350 s of simulated time.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import POSITIVE, checked
from evoros.fitness.equation_one import NOTHING_DONE, equation_one
from evoros.mission.mission import Outcome

HOME = 5  # waypoints of the first phase
AT_HOME = 0.6  # the progress that was reported there


@dataclass(frozen=True)
@checked
class AsLogged:
    """Eq. 1, except that a mission that gets home goes on only with a probability.

    ``went_on`` gives that probability for each world. Otherwise the progress is 0.6. That is also
    the progress of a mission of more than ``longest_s``, which would have been run again until one
    ended sooner. The decision is drawn from the bits of the outcome, so that the same mission
    always gets the same score.
    """

    went_on: Sequence[float] = (0.0, 0.0, 0.0)  # in the order of the worlds
    # 350 s in the logs, in which about 10 s pass before the rover drives.
    longest_s: Annotated[float, POSITIVE] = 340.0

    def score(self, outcomes: Sequence[Outcome]) -> float:
        """The sum over the worlds."""
        return sum(map(self._mission, outcomes, self.went_on))

    def worst(self, outcomes: Sequence[Outcome]) -> float:
        """The score of no progress in any world."""
        return len(outcomes) * NOTHING_DONE

    def _mission(self, outcome: Outcome, went_on: float) -> float:
        at_home = (1.0 + AT_HOME) ** 2
        if outcome.visited < HOME:
            return equation_one(outcome)
        goes_on = luck(outcome) < went_on and outcome.time_s <= self.longest_s
        return equation_one(outcome) if goes_on else at_home


def luck(outcome: Outcome) -> float:
    """A pseudo-random number from 0 to 1 that is the same for the same mission."""
    measured = repr((outcome.time_s, outcome.distance_m, outcome.least_waypoint_distances_m))
    return int.from_bytes(hashlib.sha256(measured.encode()).digest()[:8]) / 2.0**64
