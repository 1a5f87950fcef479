"""Missions -> outcomes, by a pool: several short missions in a call, or one long one.

A call through worker processes costs the main process about 0.2 ms, and a mission in a planar
simulator takes milliseconds.
"""

import hashlib
import pickle
import zlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import dataclass, field
from functools import lru_cache, partial
from time import perf_counter
from typing import Any, TypeVar

from evoros.base.arrays import Array
from evoros.base.errors import EvorosError, InputError, RunStopped, WorkerLost
from evoros.executor.protocol import Pool
from evoros.mission.mission import Mission
from evoros.mission.outcome import LOST, Outcome
from evoros.mission.plan import STOP, describe
from evoros.mission.rollout import empty_trajectory, failed_mission, run_mission
from evoros.mission.scenario import Scenario

Result = TypeVar("Result")
MissionResult = tuple[Mission, Outcome]

CALL_S = 0.1
"""No further mission of a call begins after this time in the worker: it goes into another call.

So a call lasts hardly longer than its last mission, whose time limit the executor's is.
"""
AHEAD = 3
"""Calls submitted for each worker ahead of time: enough that none waits, few to lose."""


def compute(
    scenario: Scenario, missions: Sequence[Mission], pool: Pool, workers: int, lost: str
) -> Iterator[list[MissionResult]]:
    """The outcomes of the missions, those together that come together.

    A call that raises or is lost is tried again one mission at a time, so that its error is that
    of a single mission.

    Raises:
        RunStopped: a mission crashed or hung in spite of its retries, and ``lost`` is ``stop``.
    """
    flights = _Batch(scenario, pool, workers, list(reversed(missions)))
    try:
        while flights.submit():
            flown, failed = flights.collect(lost)
            if flown:
                yield flown
            if failed is not None:
                raise failed
    finally:
        flights.cancel()


def trajectories(
    scenario: Scenario, missions: Sequence[Mission], pool: Pool, lost: str
) -> list[Array]:
    """The trajectories of the missions, in order; without rows where one could not be flown.

    Raises:
        RunStopped: as in ``compute``.
    """
    packed = _pack(scenario)
    futures = [pool.submit(_run_for_trajectory, packed, mission) for mission in missions]
    return [
        _result_of(mission, future, lost, partial(_empty_trajectory_of, mission))
        for mission, future in zip(missions, futures, strict=True)
    ]


def _empty_trajectory_of(mission: Mission, reason: str) -> Array:
    return empty_trajectory(mission)


@dataclass(frozen=True)
class _PackedScenario:
    """A scenario for the workers. It goes with every call: any worker may be a fresh one."""

    digest: bytes  # so that a worker which has the scenario need not compare megabytes
    content: bytes = field(compare=False, repr=False)


@dataclass
class _Batch:
    """The missions of one computation: they wait, the next last, or are in a call."""

    scenario: Scenario
    pool: Pool
    workers: int
    waiting: list[Mission]
    alone: list[Mission] = field(default_factory=list)  # those of calls that went wrong
    running: dict[Future[list[Outcome]], list[Mission]] = field(default_factory=dict)
    size: int = 1  # missions for which a call has time, as far as known

    def submit(self) -> bool:
        """Keep the workers busy; False when there is nothing left to wait for."""
        while (self.alone or self.waiting) and len(self.running) < self.workers * AHEAD:
            missions = self._next()
            future = self.pool.submit(_run_missions, _pack(self.scenario), missions)
            self.running[future] = missions
            if future.done():  # in this process: to be recorded before the next one is flown
                break
        return bool(self.running)

    def _next(self) -> list[Mission]:
        if self.alone:
            return [self.alone.pop()]
        # A share of what is left: at the end no worker has much more to do than another.
        share = len(self.waiting) // (2 * self.workers)
        return [self.waiting.pop() for _ in range(max(1, min(self.size, share)))]

    def collect(self, lost: str) -> tuple[list[MissionResult], EvorosError | None]:
        """What was flown by the calls that are over, and what ends the run."""
        flown: list[MissionResult] = []
        failed: EvorosError | None = None
        for future in wait(self.running, return_when=FIRST_COMPLETED).done:
            missions = self.running.pop(future)
            if len(missions) > 1 and _error_of(future) is not None:
                self.alone += reversed(missions)
                continue
            worst = partial(_lost_outcome, self.scenario, missions[0])
            try:
                outcomes = _result_of(missions[0], future, lost, worst)
            except EvorosError as error:
                failed = failed or error
                continue
            flown += zip(missions, outcomes, strict=False)
            self._learn(missions, len(outcomes))
        return flown, failed

    def _learn(self, missions: Sequence[Mission], flown: int) -> None:
        """More missions in a call that had time for all; those without time go on waiting."""
        if flown == len(missions):
            self.size = max(self.size, flown + flown // 2 + 1)
        else:
            self.size = flown
            self.waiting += reversed(missions[flown:])

    def cancel(self) -> None:
        for future in self.running:
            future.cancel()


def _lost_outcome(scenario: Scenario, mission: Mission, reason: str) -> list[Outcome]:
    return [failed_mission(scenario, mission, LOST, reason)]


@lru_cache(maxsize=16)
def _pack(scenario: Scenario) -> _PackedScenario:
    """The scenario for the workers, packed once for all missions.

    Raises:
        InputError: a part does not pickle.
    """
    try:
        content = pickle.dumps(scenario)
    except Exception as error:  # whatever a user's class raises
        raise InputError(
            f"the experiment cannot be sent to worker processes ({error}); define every class at "
            f"the top of a module, and keep open files and the like out of descriptions"
        ) from error
    return _PackedScenario(hashlib.sha256(content).digest(), zlib.compress(content, 1))


def _result_of(
    mission: Mission, future: "Future[Result]", lost: str, worst: Callable[[str], Result]
) -> Result:
    """What the mission gave; ``worst`` of the reason where it was lost and that is no stop."""
    error = _error_of(future)
    if error is None:
        return future.result()
    if isinstance(error, EvorosError) and not isinstance(error, WorkerLost):
        raise error
    reason = str(error) if isinstance(error, WorkerLost) else f"{type(error).__name__}: {error}"
    if lost == STOP or not isinstance(error, Exception):
        raise RunStopped(f"{describe(mission)}: {reason}") from error
    return worst(reason)


def _error_of(future: "Future[Any]") -> BaseException | None:
    """What the call raised.

    Raises:
        CancelledError: the pool was closed, which says nothing about the missions.
    """
    error = future.exception()
    if isinstance(error, CancelledError):
        raise error
    return error


def _run_missions(packed: _PackedScenario, missions: Sequence[Mission]) -> list[Outcome]:
    """In a worker: the outcomes of the missions, or of the first ones, as time allows."""
    scenario, end = _unpack(packed), perf_counter() + CALL_S
    outcomes = [run_mission(scenario, missions[0])[0]]
    for mission in missions[1:]:
        if perf_counter() > end:
            break
        outcomes.append(run_mission(scenario, mission)[0])
    return outcomes


def _run_for_trajectory(packed: _PackedScenario, mission: Mission) -> Array:
    return run_mission(_unpack(packed), mission)[1]


@lru_cache(maxsize=16)
def _unpack(packed: _PackedScenario) -> Scenario:
    """Unpacked once in each worker process."""
    scenario: Scenario = pickle.loads(zlib.decompress(packed.content))
    return scenario
