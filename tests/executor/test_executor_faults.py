"""Real faults in workers, of this machine and of a cluster: calls that crash, hang, raise ..."""

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from dask_cases import cluster
from executor_calls import (
    HomeOnly,
    ParticularError,
    alive,
    children,
    die,
    die_at_first,
    fail,
    hang_in_c,
    leave,
    make_unpicklable,
    note,
    noted,
    process_id,
    segfault,
    sleep_at_first,
    sleep_long,
    square,
    wait_for,
)
from fixture_types import Folders, Patch
from proposal_sites import is_of

from evoros.base.errors import EvorosError, InputError, WorkerLost
from evoros.executor.processes import Processes
from evoros.executor.protocol import Executor, Pool
from evoros.executor.serial import Serial
from evoros.files.plugins import find_plugins

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="finds processes in /proc")

EXECUTORS = ["processes", *(["dask"] if "clusters" in find_plugins() else [])]


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: Folders) -> Iterator[str]:
    with cluster(tmp_path_factory.mktemp("cluster"), workers=2) as started:
        yield started.address


def executor(name: str, request: pytest.FixtureRequest, time_limit_s: float) -> Executor:
    limits: dict[str, Any] = {"retries": 1, "time_limit_s": time_limit_s}
    if name == "dask":
        from evoros.plugins.clusters.dask import Dask

        return Dask(request.getfixturevalue("scheduler"), **limits)
    return Processes(2, **limits)


@pytest.fixture(
    scope="module",
    params=[pytest.param(name, marks=[pytest.mark.slow] * (name == "dask")) for name in EXECUTORS],
)
def pool(request: pytest.FixtureRequest) -> Iterator[Pool]:
    with executor(request.param, request, 60).open() as pool:
        yield pool


@pytest.fixture
def no_process_left(scheduler: str) -> Iterator[None]:
    before = set(children())  # the workers of ``pool``, and the cluster
    yield
    assert set(children()) <= before


@pytest.fixture
def tally(tmp_path: Path) -> str:
    return str(tmp_path / "tally")


FAULTS: dict[str, tuple[Callable[..., Any], tuple[object, ...], str]] = {
    "killed": (die, (-signal.SIGKILL,), "signal 9"),
    "aborted": (die, (-signal.SIGABRT,), "signal 6"),
    "exits": (die, (3,), "exit code 3"),
    "exits as if all were well": (leave, (0,), "exit code 0;"),
    "exits below zero": (leave, (-5,), "exit code 251;"),
    "segfault": (segfault, (), "signal 11"),
    "sleeps": (sleep_long, (), "time_limit_s = 5 s"),
    "hangs in C": (hang_in_c, (), "time_limit_s = 5 s"),
}


@pytest.mark.slow
@pytest.mark.usefixtures("no_process_left")
@pytest.mark.parametrize("name", EXECUTORS)
def test_faults_cost_only_the_calls_that_have_them(
    name: str, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    with executor(name, request, 5).open() as pool:
        healthy, faulty = [], {}
        for index, (name, (function, arguments, _)) in enumerate(FAULTS.items()):
            healthy.append(pool.submit(square, index))
            faulty[name] = pool.submit(function, str(tmp_path / name), *arguments)
        healthy.append(pool.submit(square, len(FAULTS)))
        assert [future.result(60) for future in healthy] == [n * n for n in range(len(FAULTS) + 1)]
        for name, future in faulty.items():
            with pytest.raises(WorkerLost) as loss:
                future.result(60)
            text = str(loss.value)
            assert "\n" not in text
            assert FAULTS[name][0].__name__ in text
            assert FAULTS[name][2] in text
            attempts = noted(tmp_path / name)
            assert len(attempts) == 2
            assert not any(alive(pid) for pid in attempts)


@pytest.mark.slow
def test_a_call_that_crashes_once_succeeds_at_its_second_attempt(pool: Pool, tally: str) -> None:
    assert pool.submit(die_at_first, tally).result(60) == "survived"
    assert len(set(noted(tally))) == 2


def test_a_worker_that_is_killed_while_idle_costs_no_call() -> None:
    with Processes(workers=1, retries=1).open() as pool:
        first = pool.submit(process_id).result(60)
        os.kill(first, signal.SIGKILL)
        time.sleep(0.3)  # longer than Pebble takes to see it
        assert pool.submit(process_id).result(60) != first


@pytest.mark.parametrize(
    ("executor", "call"),
    [
        (Processes(1, retries=0), die_at_first),
        (Processes(1, retries=0, time_limit_s=1), sleep_at_first),
    ],
)
def test_what_a_lost_worker_proposes_ends_the_call(
    executor: Processes, call: Callable[[str], str], tally: str
) -> None:
    """The worker dies or hangs at the first attempt alone."""
    with executor.open() as pool, pytest.raises(WorkerLost) as lost:
        pool.submit(call, tally).result(60)
    assert is_of(str(lost.value), "evoros/executor/worker_handle.py executor=serial")
    note(tally)  # the worker may have been too slow to do so
    with Serial().open() as serial:
        assert serial.submit(call, tally).result() == "survived"


@pytest.mark.parametrize("error", [ValueError, TimeoutError, RuntimeError, WorkerLost, InputError])
def test_an_exception_is_passed_on_unchanged_and_not_repeated(
    pool: Pool, tally: str, error: type[Exception]
) -> None:
    # TimeoutError and RuntimeError are also what Pebble raises about its own processes.
    with pytest.raises(error) as raised:
        pool.submit(fail, tally, error).result(60)
    assert type(raised.value) is error
    assert raised.value.args == ("as it is", 7)
    assert "in fail" in "".join(raised.value.__notes__)  # the traceback from the worker
    assert len(noted(tally)) == 1


def test_what_cannot_be_pickled_is_an_error_of_its_own_call_only(pool: Pool, tally: str) -> None:
    """In place of it, a serial executor returns the value or raises the error."""
    with Serial().open() as serial:
        with pytest.raises(InputError) as refused:
            pool.submit(lambda: None)
        assert is_of(str(refused.value), "evoros/executor/protocol.py executor=serial")
        assert serial.submit(lambda: 3).result() == 3
        with pytest.raises(EvorosError, match="ParticularError: as it is; ") as lost:
            pool.submit(fail, tally, ParticularError).result(60)
        assert is_of(str(lost.value), "evoros/executor/worker_main.py executor=serial")
        with pytest.raises(ParticularError):
            serial.submit(fail, tally, ParticularError).result()
    with pytest.raises(EvorosError, match=r"function: .*cannot be sent back"):
        pool.submit(make_unpicklable).result(60)
    with pytest.raises(AttributeError, match="NoSuchClass"):
        pool.submit(repr, HomeOnly()).result(60)
    assert pool.submit(square, 3).result(60) == 9


@pytest.mark.slow
@pytest.mark.parametrize("jump_s", [1e6, -1e6])
def test_a_clock_that_jumps_ends_no_call(jump_s: float, tmp_path: Path, monkeypatch: Patch) -> None:
    """As when it is corrected, or after a suspend: limits are of monotonic time."""
    clock = time.time
    with Processes(1, retries=0, time_limit_s=60).open() as pool:
        assert pool.submit(square, 3).result() == 9  # the process has started
        call = pool.submit(wait_for, str(tmp_path / "end"))
        for _ in range(2):  # before the jump, and after it
            with pytest.raises(TimeoutError):
                call.result(timeout=0.5)
            monkeypatch.setattr(time, "time", lambda: clock() + jump_s)
        (tmp_path / "end").touch()
        assert call.result() == str(tmp_path / "end")
