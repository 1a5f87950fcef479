"""Missions in calls: the faults are real, in real worker processes."""

import os
import signal
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Future
from dataclasses import dataclass, field, replace
from functools import cache, partial
from pathlib import Path
from time import perf_counter
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from fixture_types import Patch
from helpers import USER_PARTS
from hypothesis import given
from hypothesis import strategies as st
from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.errors import InputError, RunStopped, SimulationError, WorkerLost
from evoros.config.compose import compose
from evoros.design.design import Design
from evoros.dispatch import calls, dispatcher
from evoros.dispatch.calls import BATCH_S, FIRST, GROWTH, Asked, Pace, find_share
from evoros.dispatch.dispatcher import CALLS_PER_WORKER, Dispatcher, MissionResult
from evoros.evolution.experiment import Experiment
from evoros.executor.processes import Processes
from evoros.executor.protocol import Executor
from evoros.executor.serial import Serial
from evoros.failure.protocol import Failure, Fault
from evoros.filter.protocol import Channels
from evoros.mission.mission import LOST, Mission, MissionKey, Outcomes
from evoros.mission.plan import STOP, WORST
from evoros.mission.scenario import Scenario

DESIGN = Design(())


@cache
def experiment() -> Experiment:
    return compose(["experiment=tiny", "executor=serial"], config_dir=USER_PARTS).build()


@cache
def missions() -> tuple[Mission, ...]:
    """Missions of 20 random designs, each in two worlds."""
    space, rng = experiment().space, np.random.default_rng(5)
    drawn = [space.decode(rng.random(space.size)) for _ in range(20)]
    plan = experiment().plan
    return tuple(m for i, design in enumerate(drawn) for m in plan.selection(0, i, design))


def flown(
    executor: Executor, scenario: Scenario, lost: str = STOP, chosen: slice = slice(None)
) -> dict[MissionKey, Outcomes]:
    wanted = missions()[chosen]
    with executor.open() as pool:
        batches = list(Dispatcher(pool, lost).run(scenario, wanted))
    pairs = [pair for batch in batches for pair in batch]
    assert len(pairs) == len(wanted)  # none twice
    return {mission.key: outcome for mission, outcome in pairs}


@cache
def sound() -> dict[MissionKey, str]:
    """Records as text: NaN is not equal to itself."""
    return as_text(flown(Serial(), harmless(99)))


def as_text(outcomes: dict[MissionKey, Outcomes]) -> dict[MissionKey, str]:
    return {place: repr(outcome) for place, outcome in outcomes.items()}


def harmless(design: int) -> Scenario:
    return trapped("nothing", design)


def trapped(what: str, design: int, tally: str = os.devnull) -> Scenario:
    """The scenario with something that happens in the missions of one design."""
    mounts = [m.design.mounts for m in missions() if m.design_id == design]
    x = mounts[0][0].x_m if mounts else -99.0
    return replace(experiment().scenario, failure=Trap(what, x, tally))


@dataclass(frozen=True)
class Trap(Failure):
    """A failure model that fails itself, where the first sensor lies at x."""

    what: str
    x: float
    tally: str

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        if float(channels.position[0, 0]) == pytest.approx(self.x, abs=1e-9):
            with Path(self.tally).open("a") as file:
                file.write("x\n")
            TRAPS[self.what]()
        return ()


def crash() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def fail() -> None:
    raise ZeroDivisionError("the trap")


def refuse() -> None:
    raise InputError("the trap: must not be stepped on; walk around it")


TRAPS: dict[str, Callable[[], None]] = {
    "crash": crash,
    "fail": fail,
    "refuse": refuse,
    "nothing": lambda: None,
}


@dataclass
class Watched:
    """A pool in this process that finishes calls when told, or at once; notes their sizes."""

    at_once: bool = False
    workers: int = 1
    shares_files: bool = True
    calls: list[tuple["Future[Any]", Callable[..., Any], tuple[Any, ...]]] = field(
        default_factory=list
    )
    sizes: list[int] = field(default_factory=list)
    most: int = 0

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        future: Future[Any] = Future()
        self.calls.append((future, function, args))
        self.sizes.append(len(args[1]))
        self.most = max(self.most, len(self.calls))
        if self.at_once:
            self.finish()
        return future

    def finish(self) -> None:
        future, function, args = self.calls.pop(0)
        future.set_result(function(*args))


@dataclass(frozen=True)
class Broken:
    """A pool whose every call ends as told."""

    error: Exception
    workers: int = 1
    shares_files: bool = True

    def submit(self, function: Any, /, *args: Any) -> "Future[Any]":
        future: Future[Any] = Future()
        future.set_exception(self.error)
        return future


# ---- what comes out


@pytest.mark.parametrize("seconds", [0.0, 1e9])
def test_outcomes_are_the_same_in_calls_of_any_size(seconds: float, monkeypatch: Patch) -> None:
    monkeypatch.setattr(calls, "CALL_S", seconds)
    assert as_text(flown(Serial(), harmless(99))) == sound()


# ---- what goes wrong


def require_own_loss_only(outcomes: dict[MissionKey, Outcomes], *reasons: str) -> None:
    """Require that the missions of design 13 are lost for reasons, and that no other is."""
    lost = {place for place, (outcome,) in outcomes.items() if outcome.ended == LOST}
    expected = {mission.key for mission in missions() if mission.design_id == 13}
    assert lost == expected & outcomes.keys()
    assert lost
    rest = {place: text for place, text in as_text(outcomes).items() if place not in lost}
    assert rest == {place: sound()[place] for place in rest}
    for place in lost:
        assert all(reason in outcomes[place][0].reason for reason in reasons)


@pytest.mark.slow
def test_an_exception_amid_a_call_costs_its_own_mission_only() -> None:
    outcomes = flown(Processes(workers=1, retries=0), trapped("fail", 13), WORST)
    require_own_loss_only(outcomes, "the trap")


@pytest.mark.slow
def test_a_fault_that_stops_the_run_is_that_of_one_mission(monkeypatch: Patch) -> None:
    """And what was flown before or in the same call is not lost with it."""
    monkeypatch.setattr(calls, "CALL_S", 1e9)  # no call ends before its last mission
    with Processes(workers=1, retries=0).open() as pool:
        for what in ("fail", "refuse", "crash"):
            recorded: list[MissionResult] = []
            said = "^the trap: must" if what == "refuse" else "the mission of design 13 in "
            error = InputError if what == "refuse" else RunStopped
            batches = Dispatcher(pool, STOP).run(trapped(what, 13), missions())
            with pytest.raises(error, match=said):
                recorded.extend(pair for batch in batches for pair in batch)
            designs = [mission.design_id for mission, _ in recorded]
            assert 13 not in designs
            assert set(range(13)) <= set(designs)


@pytest.mark.slow
def test_a_crash_amid_a_call_costs_its_own_mission_only(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.setattr(calls, "CALL_S", 1e6)  # no call ends before the mission that crashes
    scenario = trapped("crash", 13, str(tmp_path / "tally"))
    near = slice(None, None, 2)  # one mission of each design
    outcomes = flown(Processes(workers=1, retries=0), scenario, WORST, near)
    require_own_loss_only(outcomes, "lost once", "by signal 9")
    assert len((tmp_path / "tally").read_text().splitlines()) in (1, 2)


def note_rows(
    rows: dict[MissionKey, int], scenario: Scenario, mission: Mission, trajectory: Array
) -> None:
    rows[mission.key] = len(trajectory)


def test_lost_missions_stop_or_are_the_worst() -> None:
    wanted = experiment().plan.selection(3, 4, DESIGN)
    scenario = experiment().scenario
    for error in (WorkerLost("it hung"), ValueError("no\nluck")):
        with pytest.raises(RunStopped, match=r"design 4 in \w+, generation 3, trial 0: "):
            list(Dispatcher(Broken(error), STOP).run(scenario, wanted))
        rows: dict[MissionKey, int] = {}
        keep = partial(note_rows, rows)
        dispatcher = Dispatcher(Broken(error), WORST, keep_trajectory=keep)
        (*batches,) = dispatcher.run(scenario, wanted)
        assert rows == {mission.key: 0 for mission in wanted}
        outcomes = [outcome for batch in batches for _, (outcome,) in batch]
        assert {outcome.ended for outcome in outcomes} == {LOST}
        assert {outcome.progress for outcome in outcomes} == {0.0}
        assert len(outcomes) == len(wanted)
        tracks = Dispatcher(Broken(error), WORST).run_for_trajectories(scenario, wanted)
        assert [len(track) for track in tracks] == [0] * len(wanted)
        with pytest.raises(RunStopped):
            Dispatcher(Broken(error), STOP).run_for_trajectories(scenario, wanted)


@pytest.mark.parametrize("error", [InputError("bad"), SimulationError("odd"), CancelledError()])
def test_errors_of_ours_are_never_recorded_as_lost(error: Exception) -> None:
    with pytest.raises(type(error)):
        list(Dispatcher(Broken(error), WORST).run(experiment().scenario, missions()))


# ---- what is run at all


@dataclass
class Memory:
    """A record in memory; tells whether each mission was recorded before it was reported."""

    outcomes: dict[MissionKey, Outcomes] = field(default_factory=dict)
    reported: list[MissionKey] = field(default_factory=list)

    def has(self, mission: Mission) -> bool:
        return mission.key in self.outcomes

    def record(self, results: Sequence[MissionResult]) -> None:
        for mission, outcomes in results:
            assert mission.key not in self.outcomes
            self.outcomes[mission.key] = outcomes

    def keep_log(self, mission: Mission, log: str) -> None:
        raise AssertionError("no mission of these has a pilot to lose")

    def notify(self, mission: Mission, outcomes: Outcomes) -> None:
        assert self.outcomes[mission.key] is outcomes
        self.reported.append(mission.key)


@pytest.mark.parametrize("out", [1, 7, 10_000])
def test_missions_that_are_recorded_are_not_run_again(out: int, monkeypatch: Patch) -> None:
    monkeypatch.setattr(dispatcher, "MISSIONS_OUT", out)
    memory, scenario = Memory(), harmless(99)
    known = [mission for i, mission in enumerate(missions()) if i % 3 == 0]
    for results in Dispatcher(Watched(at_once=True), STOP).run(scenario, known):
        memory.record(results)
    missing = Dispatcher(Watched(at_once=True), STOP).run_missing
    missing(scenario, iter(missions()), memory, memory.notify)
    assert set(memory.outcomes) == {mission.key for mission in missions()}
    assert set(memory.reported) == set(memory.outcomes) - {mission.key for mission in known}
    assert as_text(memory.outcomes) == sound()
    missing(scenario, missions(), memory, memory.notify)
    assert len(memory.reported) == len(missions()) - len(known)


# ---- how it is done


def test_short_missions_go_together_and_long_ones_alone(monkeypatch: Patch) -> None:
    pool = Watched(at_once=True)
    monkeypatch.setattr(calls, "CALL_S", 1e9)
    list(Dispatcher(pool, STOP).run(experiment().scenario, missions()))
    assert pool.sizes[0] == FIRST
    assert max(pool.sizes) >= 7
    assert len(pool.sizes) < len(missions()) / 2
    begun = np.cumsum([0, *pool.sizes])[:-1]
    for size, before in zip(pool.sizes, begun, strict=True):
        assert size <= max(1, (len(missions()) - before) // 2)  # the end is shared evenly

    pool = Watched(at_once=True)
    monkeypatch.setattr(calls, "CALL_S", 0.0)
    monkeypatch.setattr(calls, "CALLS_PER_S", np.inf)
    list(Dispatcher(pool, STOP).run(experiment().scenario, missions()))
    assert set(pool.sizes[1:]) == {1}
    assert len(pool.sizes) == len(missions())


def begin(pool: Watched) -> dispatcher._Batch:
    scenario = experiment().scenario
    batch = Dispatcher(pool, STOP), scenario, calls.pack(scenario), iter(missions())
    return dispatcher._Batch(*batch)


def test_missions_of_calls_that_fail_are_repeated_in_their_order() -> None:
    """So that the error that ends a run comes after the missions before it."""
    pool, alone = Watched(), deque[Mission]()
    batch = begin(pool)
    batch.pace.note(1000, 1000, 1e-3)  # so quick that calls are long
    assert batch.submit()
    assert min(pool.sizes) > 1
    for future, _, (_, together, *_) in (pool.calls.pop(0) for _ in range(len(pool.calls))):
        future.set_exception(ZeroDivisionError())
        alone += together
    assert batch.collect() == ([], None)
    while alone:
        assert batch.submit()
        assert [mission.key for mission in pool.calls[0][2][1]] == [alone.popleft().key]
        pool.finish()
        batch.collect()


@pytest.mark.parametrize("workers", [1, 3])
def test_only_a_few_calls_are_submitted_ahead(workers: int) -> None:
    pool = Watched(workers=workers)
    batch = begin(pool)
    while batch.submit():
        assert len(pool.calls) <= workers * CALLS_PER_WORKER
        pool.finish()
        batch.collect()
    assert pool.most == workers * CALLS_PER_WORKER


def test_calls_ahead_follow_the_number_of_workers() -> None:
    pool = Watched(workers=0)  # none has joined, but the first may find a call
    batch = begin(pool)
    for workers, calls_out in ((0, 1), (1, 1), (2, 2), (5, 5), (1, 5)):  # none is called back
        pool.workers = workers
        assert batch.submit()
        assert len(pool.calls) == calls_out * CALLS_PER_WORKER


def test_missions_are_planned_as_calls_are_submitted(monkeypatch: Patch) -> None:
    """So that neither memory nor the start of a run grows with the number of missions."""
    monkeypatch.setattr(dispatcher, "MISSIONS_OUT", 12)
    monkeypatch.setattr(calls, "CALL_S", 1e9)
    planned, ended = 0, 0

    def plan() -> Iterator[Mission]:
        nonlocal planned
        for mission in missions():
            planned += 1
            yield mission

    pool = Watched(at_once=True, workers=2)
    for results in Dispatcher(pool, STOP).run(experiment().scenario, plan()):
        ended += len(results)
        assert planned <= ended + 12
    assert max(pool.sizes) == 12 // (2 * CALLS_PER_WORKER)
    assert planned == ended == len(missions())


def test_what_is_known_of_missions_holds_for_the_next_generation(monkeypatch: Patch) -> None:
    monkeypatch.setattr(calls, "CALL_S", 1e9)
    pool = Watched(at_once=True)
    dispatcher = Dispatcher(pool, STOP)
    for generation in range(2):
        pool.sizes.clear()
        list(dispatcher.run(experiment().scenario, missions()))
        assert (pool.sizes[0] == FIRST) == (generation == 0)


def test_the_first_mission_of_a_scenario_in_a_process_is_not_timed() -> None:
    """It loads machine code, which takes seconds."""
    packed = calls.pack(harmless(99))
    calls.unpack.cache_clear()
    timed = [calls.run_for_outcomes(packed, missions()[:3], 1e9, False).timed for _ in range(2)]
    assert timed == [2, 3]


class Together:
    """Runs the missions of several runs together, in no time."""

    def run(self, groups: Sequence[tuple[Scenario, Sequence[Mission]]]) -> list[list[Any]]:
        return [[((), None)] * len(wanted) for _, wanted in groups]


def test_runs_share_the_time_of_a_batch_by_their_missions(monkeypatch: Patch) -> None:
    monkeypatch.setitem(calls._batchers, "device", Together())
    batches: Any = SimpleNamespace(device="device", missions=8)
    asked = [Asked(missions()[:1], 1e9, False), Asked(missions()[1:4], 1e9, False)]
    begun = perf_counter()
    answers = calls.run_batches(batches, asked, *[calls.pack(harmless(99))] * 2)
    assert [answer.timed for answer in answers] == [1, 3]
    assert answers[1].seconds == pytest.approx(3 * answers[0].seconds)
    assert sum(answer.seconds for answer in answers) <= perf_counter() - begun


def test_a_batch_is_full_with_its_missions_or_after_its_time() -> None:
    pace, batches = Pace(), cast(Any, SimpleNamespace(missions=400))
    assert [find_share(pace, count, batches) for count in (100, 400)] == [0.25, 1.0]
    pace.note(10, 10, BATCH_S)
    assert [find_share(pace, count, batches) for count in (5, 10, 30)] == [0.5, 1.0, 3.0]


@given(mission_s=st.floats(1e-5, 30.0), call_s=st.floats(0.05, 5.0), before_s=st.floats(1e-5, 30.0))
def test_calls_get_as_many_missions_as_they_have_time_for(
    mission_s: float, call_s: float, before_s: float
) -> None:
    """Also if missions took another time before, as those of other designs do."""
    pace = Pace()
    for now_s in (before_s, mission_s):
        for _ in range(200):
            size = pace.fit(call_s)
            assert 1 <= size <= max(FIRST, GROWTH * pace.most)
            finished = min(size, int(call_s / now_s) + 1)
            pace.note(finished, finished, finished * now_s)
    assert pace.fit(call_s) - 0.5 == pytest.approx(call_s / mission_s, rel=0.01, abs=0.6)


def test_many_workers_get_longer_calls_and_few_get_the_shortest() -> None:
    times = [calls.call_time(workers) for workers in (1, 2, 8, 64, 512, 4096)]
    assert times == sorted(times)
    assert times[:2] == [calls.CALL_S] * 2
    for workers in (64, 512, 4096):
        assert workers / calls.call_time(workers) <= calls.CALLS_PER_S


def test_what_runs_in_this_process_is_recorded_before_the_next_call_begins() -> None:
    pool = Watched(at_once=True)
    batches = Dispatcher(pool, STOP).run(experiment().scenario, missions())
    for index, _ in zip(range(1, 6), batches, strict=False):
        assert len(pool.sizes) == index


@dataclass(frozen=True)
class Counted(Failure):
    """A failure model that counts how often it is packed and unpacked, in this process."""

    packed: int = 0

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        return ()

    def __reduce__(self) -> tuple[Any, ...]:
        COUNT["packed"] += 1
        return (unpack, ())


COUNT = {"packed": 0, "unpacked": 0}


def unpack() -> Counted:
    COUNT["unpacked"] += 1
    return Counted()


def test_the_task_is_packed_once_and_unpacked_once() -> None:
    scenario = replace(experiment().scenario, failure=Counted())
    for _ in range(2):
        assert len(list(Dispatcher(Watched(at_once=True), STOP).run(scenario, missions()))) > 2
    assert COUNT == {"packed": 1, "unpacked": 1}


@pytest.mark.slow
def test_a_fresh_worker_gets_the_task(monkeypatch: Patch) -> None:
    monkeypatch.setattr(calls, "CALL_S", 0.0)
    expected = dict([*sound().items()][:6])
    executor = Processes(workers=1, calls_per_worker=3)  # for six calls
    assert as_text(flown(executor, harmless(99), chosen=slice(6))) == expected
