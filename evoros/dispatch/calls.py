"""The calls that workers run: several short missions, or one long one."""

import pickle
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from time import perf_counter
from typing import NamedTuple

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.executor.payload import KEPT, Shared
from evoros.mission.mission import Mission
from evoros.mission.outcome import Outcomes
from evoros.mission.rollout import run_mission
from evoros.mission.scenario import Scenario

CallResult = tuple[Outcomes, Array | None]
"""The outcomes of a mission, and its trajectory if that is kept."""


class CallAnswer(NamedTuple):
    """The results of the missions of a call that ran, and the time [s] of the last ``timed`` ones.

    The first mission of a scenario in a process loads machine code, so it is not timed.
    """

    results: list[CallResult]
    timed: int = 0
    seconds: float = 0.0
    note: str = ""  # for the user, once


CALL_S = 0.1
"""After this time [s] a worker leaves the rest of a call's missions to other calls.

So a call takes hardly longer than its last mission, to which the executor's time limit applies.
"""
CALLS_PER_S = 250
"""Calls of many workers are longer, so that the main process need not answer more of them [1/s]."""
FIRST = 1
"""Missions in a call while nothing is known."""
GROWTH = 8
"""A call has at most so many times the missions of any call before it."""
MEMORY = 0.9
"""Weight of a call relative to the call that ended after it."""


@lru_cache(maxsize=KEPT)
def pack(scenario: Scenario) -> Shared:
    """Pickle a scenario, once for all its missions.

    Raises:
        InputError: a part does not pickle.
    """
    try:
        content = pickle.dumps(scenario)
    except Exception as error:  # a user's class may raise anything
        raise InputError(
            f"the experiment cannot be sent to worker processes ({error}); define every class at "
            f"the top of a module, and keep open files and the like out of descriptions"
        ) from error
    return Shared.of(zlib.compress(content, 1))


@lru_cache(maxsize=KEPT)
def unpack(packed: Shared) -> Scenario:
    """Unpickle a scenario, once in each worker process."""
    scenario: Scenario = pickle.loads(zlib.decompress(packed.content))
    return scenario


def call_time(workers: int) -> float:
    """Return the time [s] after which none of so many workers starts another mission of a call."""
    return max(CALL_S, workers / CALLS_PER_S)


def run_for_outcomes(
    packed: Shared, missions: Sequence[Mission], seconds: float, keep: bool
) -> CallAnswer:
    """Run missions in order until the time [s] is over; return the outcomes of those that ran.

    With ``keep``, their trajectories are returned, too.

    Raises:
        PilotLost: a mission lost its pilot.
    """
    known = unpack.cache_info().misses
    scenario, begun = unpack(packed), perf_counter()
    end, first = begun + seconds, 0
    results: list[CallResult] = []
    for mission in missions:
        if results and perf_counter() > end:
            break
        outcomes, trajectory = run_mission(scenario, mission)
        results.append((outcomes, trajectory if keep else None))
        if unpack.cache_info().misses > known and len(results) == 1:
            begun, first = perf_counter(), 1
    return CallAnswer(results, len(results) - first, perf_counter() - begun)


def run_for_trajectory(packed: Shared, mission: Mission) -> Array:
    """Run one mission and return its trajectory, (rows, columns + sensors)."""
    return run_mission(unpack(packed), mission)[1]


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

    def expect(self, missions: int) -> float:
        """Return the time [s] that so many missions take; 0 while nothing is known."""
        return missions * self.seconds / self.missions if self.missions else 0.0

    def fit(self, seconds: float) -> int:
        """Return how many missions a worker begins within the time [s] of a call."""
        if not self.missions:
            return FIRST
        most = max(FIRST, GROWTH * self.most)
        return 1 + int(min(most - 1, seconds * self.missions / max(self.seconds, 1e-9)))
