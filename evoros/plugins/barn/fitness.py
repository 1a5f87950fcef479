"""The score of the BARN challenge."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import NOT_NEGATIVE, POSITIVE, checked
from evoros.base.errors import InputError
from evoros.fitness.protocol import AdditiveFitness
from evoros.mission.mission import Outcome
from evoros.world.model import World

SHORTEST, LONGEST = 2.0, 8.0  # limits of mission times, as multiples of the optimal time


@dataclass(frozen=True)
@checked
class Barn(AdditiveFitness):
    """The mean of ``optimal time / time``, clipped, over all worlds; 0 for incomplete missions.

    The optimal time is the length of the shortest path divided by ``speed_mps``. Times are clipped
    to 2 to 8 times the optimal time, so a completed mission scores 0.125 to 0.5. ``way_weight``
    times the covered fraction of the path is added to guide a search while few designs succeed.
    """

    speed_mps: Annotated[float, POSITIVE] = 2.0
    way_weight: Annotated[float, NOT_NEGATIVE] = 0.0

    @property
    def title(self) -> str:
        """The name in figures, which says whether progress along the path counts."""
        return "BARN score and path" if self.way_weight > 0 else "BARN score"

    def bounds(self, worlds: int) -> tuple[float, float]:
        """Return the minimum and maximum score for any number of worlds."""
        return 0.0, 1.0 / SHORTEST + self.way_weight

    def score(self, outcomes: Sequence[Outcome]) -> float:
        """Return the mean over the missions."""
        return math.fsum(self.score_missions(outcomes)) / len(outcomes)

    def score_missions(self, outcomes: Sequence[Outcome]) -> list[float]:
        """Return the challenge score of each mission, plus the weighted progress along the path."""
        return [
            score_mission(outcome, self.speed_mps) + self.way_weight * share_way(outcome)
            for outcome in outcomes
        ]

    def worst(self, outcomes: Sequence[Outcome]) -> float:
        """Return 0, the score of a robot that does not move."""
        return 0.0

    def check_worlds(self, worlds: Mapping[str, World]) -> None:
        """Check that the length of the shortest path is known in all worlds."""
        for name, world in worlds.items():
            if world.shortest_m is None:
                raise InputError(
                    f"world.{name}: the world must have shortest_m, the length of the shortest "
                    "path, for fitness=barn; use world=barn, or another fitness"
                )


def score_mission(outcome: Outcome, speed_mps: float = 2.0) -> float:
    """Return the challenge score of a mission: 0, or 0.125 to 0.5."""
    if not outcome.completed or outcome.shortest_m is None:
        return 0.0
    optimal = outcome.shortest_m / speed_mps
    return optimal / min(max(outcome.time_s, SHORTEST * optimal), LONGEST * optimal)


def share_way(outcome: Outcome) -> float:
    """Return the robot's progress to the goal as a fraction (0 to 1) of the shortest path."""
    if outcome.completed:
        return 1.0
    if outcome.shortest_m is None or not outcome.least_waypoint_distances_m:
        return 0.0
    *_, goal, _ = outcome.least_waypoint_distances_m  # home is last
    return min(max(1.0 - goal / outcome.shortest_m, 0.0), 1.0)
