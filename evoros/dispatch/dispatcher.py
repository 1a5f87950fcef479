"""Dispatch of missions to a pool, with several short missions or one long mission per call."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import CancelledError, Future
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import islice
from queue import Empty, SimpleQueue
from typing import Protocol

from evoros.base.arrays import Array
from evoros.base.errors import EvorosError, LaunchError, PilotLost, RunStopped, WorkerLost
from evoros.dispatch.calls import (
    BATCH_S,
    Asked,
    CallAnswer,
    Pace,
    call_time,
    find_share,
    pack,
    run_batches,
    run_for_outcomes,
)
from evoros.executor.protocol import ALONE, BatchPool, Pool, Shared
from evoros.mission.mission import LOST, Mission, Outcomes
from evoros.mission.plan import STOP, describe
from evoros.mission.rollout import empty_trajectory, failed_mission
from evoros.mission.scenario import Scenario
from evoros.terminal.log import LOGGER

MissionResult = tuple[Mission, Outcomes]


class MissionRecord(Protocol):
    """A store for the outcomes of missions."""

    def has(self, mission: Mission) -> bool:
        """Return True if a mission is recorded; raise an InputError if its draws differed."""

    def record(self, results: Sequence[MissionResult]) -> None:
        """Record finished missions."""


CALLS_PER_WORKER = 3  # calls submitted ahead to keep workers busy; few are repeated after a crash
NEW_WORKERS_S = 1.0  # maximum time until new workers receive calls
MISSIONS_OUT = 50_000  # maximum number of missions in submitted calls, which limits the memory use


@dataclass
class Meter:
    """Adds up the processor time of calls."""

    processor_s: float = 0.0


@dataclass(frozen=True)
class Dispatcher:
    """Runs missions in an open pool."""

    pool: Pool
    lost: str  # STOP or WORST, the reaction to a mission that crashes or hangs
    keep_log: Callable[[Mission, str], None] = lambda *_: None  # called for lost missions
    keep_trajectory: Callable[[Scenario, Mission, Array], None] | None = None
    """Receives the trajectory of each mission in ``run`` before the outcome is yielded."""
    paces: dict[bytes, Pace] = field(default_factory=dict)  # keyed by scenario digest
    meter: Meter = field(default_factory=Meter)
    told: set[str] = field(default_factory=set)  # logged notes from workers

    def run_missing(
        self,
        scenario: Scenario,
        missions: Iterable[Mission],
        record: MissionRecord,
        notify: Callable[[Mission, Outcomes], None],
    ) -> None:
        """Run the missions that are not in ``record``; record each, then call ``notify``."""
        missing = (mission for mission in missions if not record.has(mission))
        for results in self.run(scenario, missing):
            record.record(results)
            for result in results:
                notify(*result)

    def run(self, scenario: Scenario, missions: Iterable[Mission]) -> Iterator[list[MissionResult]]:
        """Run the missions, and yield outcomes in any order as calls finish.

        A failed call is repeated one mission at a time, so that an error can be attributed to one.
        A mission lost despite its retries raises a RunStopped if ``lost`` is ``STOP``.
        """
        batch = _Batch(self, scenario, pack(scenario), iter(missions))
        try:
            while batch.submit():
                results, error = batch.collect()
                if results:
                    yield results
                if error is not None:
                    raise error
        finally:
            batch.cancel()

    def run_for_trajectories(self, scenario: Scenario, missions: Sequence[Mission]) -> list[Array]:
        """Run the missions and return their trajectories in order, empty for lost missions."""
        tracks: dict[int, Array] = {}

        def keep(scenario: Scenario, mission: Mission, trajectory: Array) -> None:
            tracks[id(mission)] = trajectory

        for _ in replace(self, keep_trajectory=keep).run(scenario, missions):
            pass
        return [tracks[id(mission)] for mission in missions]

    def take_answer(
        self, scenario: Scenario, mission: Mission, future: Future[CallAnswer]
    ) -> CallAnswer:
        """Return a call's answer; if it is lost, return failed outcomes or raise RunStopped."""
        error = _error_of(future)
        if error is None:
            return future.result()
        if isinstance(error, LaunchError):
            raise LaunchError(f"{describe(mission)}: {error}") from error
        if isinstance(error, EvorosError) and not isinstance(error, WorkerLost):
            raise error
        if isinstance(error, PilotLost):
            self.keep_log(mission, error.log)
        reason = str(error)
        if not isinstance(error, WorkerLost):
            reason = f"{type(error).__name__}: {error}"
        if self.lost == STOP or not isinstance(error, Exception):
            raise RunStopped(f"{describe(mission)}: {reason}") from error
        outcomes = failed_mission(scenario, mission, LOST, reason)
        return CallAnswer([(outcomes, empty_trajectory(scenario, mission))])


@dataclass
class _Batch:
    """The unfinished missions of one ``Dispatcher.run``: not submitted, waiting or in a call."""

    dispatcher: Dispatcher
    scenario: Scenario
    packed: Shared
    coming: Iterator[Mission]
    waiting: deque[Mission] = field(default_factory=deque)
    alone: deque[Mission] = field(default_factory=deque)  # missions of failed calls, in order
    calls: dict[Future[CallAnswer], list[Mission]] = field(default_factory=dict)
    finished: SimpleQueue[Future[CallAnswer]] = field(default_factory=SimpleQueue)

    def __post_init__(self) -> None:
        self.pool = self.dispatcher.pool
        self.pace = self.dispatcher.paces.setdefault(self.packed.digest, Pace())

    def submit(self) -> bool:
        """Submit calls until all workers are busy; return True if calls are running."""
        workers = max(1, self.pool.workers)  # before the first worker has joined
        seconds, keep = call_time(workers), self.dispatcher.keep_trajectory is not None
        while len(self.calls) < workers * CALLS_PER_WORKER:
            is_alone = bool(self.alone)
            missions = self._pop_missions(workers, seconds)
            if not missions:
                break
            future = self._call(Asked(missions, seconds, keep), is_alone)
            self.calls[future] = missions
            future.add_done_callback(self.finished.put)
            if future.done():  # a serial pool: record before the next mission starts
                break
        return bool(self.calls)

    def _call(self, asked: Asked, is_alone: bool) -> Future[CallAnswer]:
        if not isinstance(self.pool, BatchPool):
            return self.pool.submit(run_for_outcomes, self.packed, *asked)
        share = find_share(self.pace, len(asked.missions), self.pool.batches)
        share = ALONE if is_alone else share
        return self.pool.join(run_batches, self, share, self.packed, asked)

    def _pop_missions(self, workers: int, seconds: float) -> list[Mission]:
        if self.alone:
            return [self.alone.popleft()]
        most = max(1, MISSIONS_OUT // (CALLS_PER_WORKER * workers))
        if isinstance(self.pool, BatchPool):
            seconds, most = BATCH_S, min(most, self.pool.batches.missions)
        size = min(self.pace.fit(seconds), most)
        if self.scenario.is_live:
            size = 1  # the executor then repeats only one mission
        # Workers share the last missions equally, so that they finish at about the same time.
        shares = 2 * workers
        self.waiting.extend(islice(self.coming, max(0, size * shares - len(self.waiting))))
        size = max(1, min(size, len(self.waiting) // shares))
        return [self.waiting.popleft() for _ in range(min(size, len(self.waiting)))]

    def collect(self) -> tuple[list[MissionResult], EvorosError | None]:
        """Wait up to ``NEW_WORKERS_S``; return new results, and the error that ends the run."""
        dispatcher = self.dispatcher
        results: list[MissionResult] = []
        first_error: EvorosError | None = None
        finished: list[Future[CallAnswer]] = []
        with suppress(Empty):
            finished.append(self.finished.get(timeout=NEW_WORKERS_S))
            while True:
                finished.append(self.finished.get_nowait())
        for future in finished:
            missions = self.calls.pop(future)
            error = _error_of(future)
            if len(missions) > 1 and error is not None:
                self.alone.extend(missions)
                continue
            try:
                answer = dispatcher.take_answer(self.scenario, missions[0], future)
            except EvorosError as problem:
                first_error = first_error or problem
                continue
            for mission, (outcomes, trajectory) in zip(missions, answer.results, strict=False):
                if dispatcher.keep_trajectory is not None and trajectory is not None:
                    dispatcher.keep_trajectory(self.scenario, mission, trajectory)
                results.append((mission, outcomes))
            if answer.note and answer.note not in dispatcher.told:
                dispatcher.told.add(answer.note)
                LOGGER.warning("%s", answer.note)
            dispatcher.meter.processor_s += answer.processor_s
            self.pace.note(len(answer.results), answer.timed, answer.seconds)
            self.waiting.extendleft(reversed(missions[len(answer.results) :]))  # no time was left
        return results, first_error

    def cancel(self) -> None:
        for future in self.calls:
            future.cancel()


def _error_of(future: Future[CallAnswer]) -> BaseException | None:
    """Return the exception of a call, or None; raise a CancelledError if the pool was closed."""
    error = future.exception()
    if isinstance(error, CancelledError):
        raise error
    return error
