"""A dask cluster under real faults: workers killed, stopped, added and unfit; a dead scheduler."""

import os
import pickle
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from dask_cases import SETTINGS, Cluster, cluster, freeze
from distributed import Client
from executor_calls import (
    alive,
    kill_companion,
    kill_worker,
    noted,
    process_id,
    sleep_long,
    square,
    threads_of_numpy,
    wait_until,
)
from fixture_types import Capture, Folders, Log, Patch
from helpers import ROOT, TINY, content, finished_run, resume, start, wait_for_missions

from evoros.base.errors import InputError, RunStopped, WorkerLost
from evoros.cli.main import evoros
from evoros.executor.protocol import ONE_THREAD, pack_call
from evoros.executor.worker_handle import Limits
from evoros.plugins.clusters import dask_transport
from evoros.plugins.clusters.companion import Request
from evoros.plugins.clusters.dask import Dask
from evoros.plugins.clusters.dask_transport import connect
from evoros.plugins.clusters.node import describe_environment
from evoros.terminal.console import DONE, STOPPED

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="stops processes by signals")

LIMIT_S = 120.0
SLOWLY = ("simulator.pause_s=0.05", "executor=dask", "hydra.run.dir=run")
GENERATIONS = "optimizer.generations=4"
HASTY = "evoros.plugins.clusters.tests.hasty_dask"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: Folders) -> dict[str, str]:
    """A run in one process."""
    return content(finished_run(tmp_path_factory.mktemp("whole") / "run", GENERATIONS))


@pytest.fixture(scope="module")
def started(tmp_path_factory: Folders) -> Iterator[Cluster]:
    with cluster(tmp_path_factory.mktemp("cluster"), workers=2) as running:
        yield running


@pytest.mark.slow
def test_workers_lost_stopped_and_added_in_mid_run_change_nothing(
    whole: dict[str, str], tmp_path: Path
) -> None:
    """The folders of the user's parts, which no worker sees, change nothing either."""
    with cluster(tmp_path, workers=2) as unsteady:
        run = start([*TINY, GENERATIONS, *SLOWLY, unsteady.key], tmp_path)
        wait_for_missions(tmp_path / "run", 6)
        unsteady.workers[0].kill()
        wait_for_missions(tmp_path / "run", 8)
        freeze(unsteady.workers[1])
        unsteady.add_worker()
        _, errors = run.communicate(timeout=LIMIT_S)
        assert run.returncode == DONE, errors
    assert "Traceback" not in errors
    assert content(tmp_path / "run") == whole


@pytest.mark.slow
def test_a_killed_scheduler_stops_the_run_in_one_line_and_a_cluster_of_its_own_goes_on_with_it(
    whole: dict[str, str], tmp_path: Path, monkeypatch: Patch
) -> None:
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "tests"))
    with cluster(tmp_path, workers=1) as first:
        run = start([*TINY, GENERATIONS, *SLOWLY, first.key], tmp_path, HASTY)
        wait_for_missions(tmp_path / "run", 8)
        assert first.scheduler is not None
        first.scheduler.kill()
        _, errors = run.communicate(timeout=LIMIT_S)
        assert run.returncode == STOPPED
        last = errors.splitlines()[-1]
        assert f"the Dask scheduler at {first.address} exited or can no longer be reached" in last
        assert "to continue, type: evoros resume run" in last
        assert not any(sign in errors for sign in ("Traceback", "distributed"))
    assert resume(tmp_path / "run", "executor.address=null", "executor.workers=2") == DONE
    assert content(tmp_path / "run") == whole


@pytest.mark.slow
def test_a_cluster_of_its_own_listens_on_loopback_only_and_ends_with_a_killed_main_process(
    tmp_path: Path,
) -> None:
    """Even a worker that is stopped."""
    endless = [*TINY, *SLOWLY, "optimizer.generations=1000", "executor.workers=2"]
    run = start(endless, tmp_path)
    # Two workers, and the process of each, which it starts with its first mission.
    assert wait_until(lambda: len(spawned(run.pid)) == 4, LIMIT_S)
    family = descendants(run.pid)
    addresses = {address for pid in (run.pid, *family) for address in listening(pid)}
    assert addresses == {"0100007F"}  # 127.0.0.1, as the kernel writes it
    for pid in spawned(run.pid):
        os.kill(pid, signal.SIGSTOP)
    run.kill()
    run.communicate(timeout=LIMIT_S)
    assert wait_until(lambda: not any(map(alive, family)), LIMIT_S)


@pytest.mark.slow
def test_nobody_at_the_address_is_told_in_one_line(
    whole: dict[str, str], tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    monkeypatch.setattr(dask_transport, "CONNECT_S", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    address = f"executor.address=tcp://127.0.0.1:{port}"
    assert (
        evoros([*TINY, GENERATIONS, "executor=dask", address, f"hydra.run.dir={tmp_path}/run"])
        == STOPPED
    )
    *_, line = capsys.readouterr().err.splitlines()  # behind the progress of the attempts
    assert f"executor.address: no Dask scheduler answers at tcp://127.0.0.1:{port}" in line
    assert f"to continue, type: evoros resume {tmp_path}/run" in line
    assert resume(tmp_path / "run", "executor=serial") == DONE
    assert content(tmp_path / "run") == whole


@pytest.mark.slow
def test_a_scheduler_is_found_by_its_file(
    started: Cluster, tmp_path: Path, monkeypatch: Patch
) -> None:
    with Dask(str(started.folder / "scheduler.json")).open() as pool:
        assert pool.submit(square, 6).result(LIMIT_S) == 36
    monkeypatch.setattr(dask_transport, "CONNECT_S", 0.5)
    with (
        pytest.raises(RunStopped, match=r"none\.json is not a scheduler file"),
        Dask(str(tmp_path / "none.json")).open(),
    ):
        pass


@pytest.mark.slow
def test_workers_with_other_software_get_no_calls(tmp_path: Path, caplog: Log) -> None:
    """Each pool logs such a worker once, and a suitable worker runs all calls."""
    other = tmp_path / "other"
    package = other / "numba-0.0.1.dist-info"
    package.mkdir(parents=True)
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: numba\nVersion: 0.0.1\n")
    with cluster(tmp_path, workers=0) as mixed:
        mixed.add_worker({"PYTHONPATH": str(other)})
        with Dask(mixed.address).open() as pool:
            assert wait_until(lambda: pool.workers == 1, LIMIT_S)
            with pytest.raises(RunStopped, match=r"no worker .* is suitable.*numba 0\.0\.1, not"):
                pool.submit(square, 2).result(LIMIT_S)
        mixed.add_worker()
        with Dask(mixed.address).open() as pool:
            assert wait_until(lambda: pool.workers == 2, LIMIT_S)
            calls = [pool.submit(square, n) for n in range(20)]
            assert [call.result(LIMIT_S) for call in calls] == [n * n for n in range(20)]
    told = [r.getMessage() for r in caplog.records if "gets no missions" in r.getMessage()]
    assert 1 <= len(told) <= 2  # one a pool; the second may have sent it nothing
    assert all(describe_environment()["numba"] in line and "\n" not in line for line in told)


@pytest.mark.slow
def test_a_call_that_kills_its_workers_is_found_and_costs_no_other(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    """Running and waiting calls in the same worker, which dask blames as well, are not lost."""
    monkeypatch.setitem(SETTINGS, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "1")
    tally = str(tmp_path / "tally")
    with cluster(tmp_path, workers=0) as nannied:
        nannied.add_worker(None, "--nanny", "--nthreads", "2")
        with Dask(nannied.address).open() as pool:
            assert pool.submit(square, 0).result(LIMIT_S) == 0
            killer = pool.submit(kill_worker, tally)
            beside = pool.submit(time.sleep, 2)  # it ends with each worker that the other kills
            behind = [pool.submit(square, n) for n in range(1, 5)]
            with pytest.raises(WorkerLost, match="lost, because at least 4 Dask workers") as loss:
                killer.result(LIMIT_S)
            assert beside.result(LIMIT_S) is None
            assert [call.result(LIMIT_S) for call in behind] == [1, 4, 9, 16]
            assert pool.submit(square, 5).result(LIMIT_S) == 25
    assert "\n" not in str(loss.value)
    assert 4 <= len(noted(tally)) <= 8


@pytest.mark.slow
def test_a_call_that_kills_the_process_beside_its_worker_is_lost_and_the_worker_goes_on(
    started: Cluster, tmp_path: Path
) -> None:
    tally = str(tmp_path / "tally")
    with Dask(started.address).open() as pool:
        with pytest.raises(WorkerLost, match="kill_companion: lost 2 times") as loss:
            pool.submit(kill_companion, tally).result(LIMIT_S)
        assert [pool.submit(square, n).result(LIMIT_S) for n in range(4)] == [0, 1, 4, 9]
    assert "\n" not in str(loss.value)
    assert len(noted(tally)) >= 2  # dask begins one more if the worker missed its heartbeats
    assert wait_until(lambda: not any(map(alive, noted(tally))), LIMIT_S)


@pytest.mark.slow
def test_a_call_for_workers_that_have_all_left_runs_in_one_that_joins(tmp_path: Path) -> None:
    """dask itself leaves it waiting, although it allows other workers."""
    gone, request = "tcp://127.0.0.1:9", pickle.dumps(pack_request(pow, 3, 2))
    wanted = dict(describe_environment())
    with (
        cluster(tmp_path, workers=0) as empty,
        Client(empty.address, set_as_default=False) as client,
        connect(empty.address) as transport,
    ):
        dasks = client.submit(pow, 3, 2, workers=[gone], allow_other_workers=True)
        ours = transport.send("square", wanted, request, gone)
        time.sleep(1.0)
        empty.add_worker()
        _, content, _, _ = ours.result(LIMIT_S)
        assert pickle.loads(content) == 9
        assert dasks.status == "pending"


def pack_request(function: Callable[..., Any], *args: object) -> Request:
    call = pack_call(function, args)
    return Request("pool", Limits(time_limit_s=60.0), None, call.name, call.payload, ())


@pytest.mark.slow
def test_the_number_of_workers_follows_the_cluster(tmp_path: Path) -> None:
    with cluster(tmp_path, workers=0) as growing, Dask(growing.address).open() as pool:
        assert pool.workers == 0
        waiting = pool.submit(square, 3)
        growing.add_worker()
        assert waiting.result(LIMIT_S) == 9
        growing.add_worker(None, "--nthreads", "3")
        assert wait_until(lambda: pool.workers == 4, LIMIT_S)
        growing.workers[1].terminate()
        assert wait_until(lambda: pool.workers == 1, LIMIT_S)


@pytest.mark.slow
def test_leaving_a_cluster_ends_its_calls_and_leaves_the_workers(
    started: Cluster, tmp_path: Path
) -> None:
    tally = str(tmp_path / "tally")
    with Dask(started.address).open() as pool:
        first = pool.submit(process_id).result(LIMIT_S)
        pool.submit(sleep_long, tally)
        assert wait_until(lambda: bool(noted(tally)), LIMIT_S)
    assert wait_until(lambda: not any(map(alive, (first, *noted(tally)))), LIMIT_S)
    with Dask(started.address).open() as pool:
        assert pool.submit(square, 4).result(LIMIT_S) == 16
        assert pool.submit(threads_of_numpy).result(LIMIT_S) == dict.fromkeys(ONE_THREAD, "1")


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"address": "host"}, "Dask.address: must be the address of a Dask scheduler"),
        ({"address": ""}, "Dask.address: must be"),
        ({"address": 8786}, "Dask.address: must be"),
        ({"address": "tcp://a:1", "workers": 2}, "executor.workers: must be null, not 2, if"),
        ({"workers": -1}, "Dask.workers: must be an integer >= 0, or null"),
        ({"time_limit_s": 0}, "Dask.time_limit_s: must be a positive number"),
        ({"retries": 0.5}, "Dask.retries: must be"),
    ],
)
def test_a_bad_value_is_refused_in_one_line(values: dict[str, object], said: str) -> None:
    with pytest.raises(InputError) as refusal:
        Dask(**values)  # type: ignore[arg-type]
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)


def descendants(pid: int) -> list[int]:
    """All living processes below one, the nearest first."""
    parents: dict[int, int] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except (FileNotFoundError, ProcessLookupError):
            continue
        parents[int(stat.parent.name)] = int(fields[1])
    pids, level = [], [pid]
    while level:
        level = [child for child, parent in parents.items() if parent in level]
        pids += level
    return pids


def spawned(pid: int) -> list[int]:
    """The living processes below one that multiprocessing has started."""
    pids = []
    for child in descendants(pid):
        with suppress(FileNotFoundError, ProcessLookupError):
            if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes():
                pids.append(child)
    return pids


def listening(pid: int) -> set[str]:
    """The addresses on which a process listens."""
    sockets = set()
    for link in Path(f"/proc/{pid}/fd").glob("*"):
        try:
            sockets.add(os.readlink(link).removeprefix("socket:[").rstrip("]"))
        except FileNotFoundError:
            continue
    pids = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            columns = line.split()
            if columns[3] == "0A" and columns[9] in sockets:
                pids.add(columns[1].partition(":")[0])
    return pids
