"""What a worker runs in one call: several short missions, or one long one."""

import hashlib
import pickle
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from time import perf_counter

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.mission.mission import Mission
from evoros.mission.outcome import Outcome
from evoros.mission.rollout import run_mission
from evoros.mission.scenario import Scenario

CallResult = tuple[Outcome, Array | None]
"""The outcome of a mission, and its trajectory if that is kept."""

CALL_S = 0.1
"""After this time [s] a worker starts no further mission of a call; they go into another call.

So a call takes hardly longer than its last mission, to which the executor's time limit applies.
"""


@dataclass(frozen=True)
class PackedScenario:
    """A pickled scenario. It travels with every call, because any worker may be a fresh one."""

    digest: bytes  # a worker compares these 32 bytes and not megabytes
    content: bytes = field(compare=False, repr=False)


@lru_cache(maxsize=16)
def pack(scenario: Scenario) -> PackedScenario:
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
    return PackedScenario(hashlib.sha256(content).digest(), zlib.compress(content, 1))


@lru_cache(maxsize=16)
def _unpack(packed: PackedScenario) -> Scenario:
    """Unpickle a scenario, once in each worker process."""
    scenario: Scenario = pickle.loads(zlib.decompress(packed.content))
    return scenario


def run_for_outcomes(
    packed: PackedScenario, missions: Sequence[Mission], keep: bool = False
) -> list[CallResult]:
    """Run missions in order until ``CALL_S`` is over; return the outcomes of those that ran.

    With ``keep``, their trajectories are returned, too.

    Raises:
        PilotLost: a mission lost its pilot.
    """
    scenario, end = _unpack(packed), perf_counter() + CALL_S
    results = [run_mission(scenario, missions[0])]
    for mission in missions[1:]:
        if perf_counter() > end:
            break
        results.append(run_mission(scenario, mission))
    return [(outcome, trajectory if keep else None) for outcome, trajectory in results]


def run_for_trajectory(packed: PackedScenario, mission: Mission) -> Array:
    """Run one mission and return its trajectory, (rows, columns + sensors)."""
    return run_mission(_unpack(packed), mission)[1]
