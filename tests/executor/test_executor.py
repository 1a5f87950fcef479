"""Every executor computes, is set up as documented, and leaves no worker when it ends."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from pathlib import Path
from types import NoneType
from typing import Any

import executor_calls
import pytest
from bundled_parts import every
from executor_calls import (
    alive,
    children,
    everyone,
    hang_with_child,
    meet,
    note,
    noted,
    process_id,
    square,
    start_and_leave,
    threads_of_numpy,
    wait_until,
)
from hydra.utils import instantiate
from omegaconf import OmegaConf
from pebble.pool.process import WorkerManager

from evoros.base.errors import WorkerLost
from evoros.executor.processes import Processes, available_cores, read_quota
from evoros.executor.protocol import ONE_THREAD, Pool
from evoros.files.plugins import conf_folders
from evoros.testing import ExecutorSuite

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="finds processes in /proc")


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    with Processes(workers=2, retries=1, time_limit_s=60).open() as pool:
        yield pool


class TestConfiguredExecutors(ExecutorSuite):
    choose = every(
        "executor", [pytest.param("dask", marks=pytest.mark.slow), "processes", "serial"]
    )

    def test_its_configuration_has_its_fields(self, request: pytest.FixtureRequest) -> None:
        name = request.node.callspec.params["choose"]
        files = (folder / "executor" / f"{name}.yaml" for folder in conf_folders())
        configuration = OmegaConf.load(next(file for file in files if file.exists()))
        assert {"_target_", *vars(self.part)} == set(configuration)


class TestOneProcess(ExecutorSuite):
    part = Processes(workers=1)


class TestThreeProcesses(ExecutorSuite):
    part = Processes(workers=3)
    bad_values = (
        *({"workers": value} for value in (-1, 1.0, "all", True, float("nan"))),
        *({"time_limit_s": value} for value in (0, -1, None, "10", float("inf"), True)),
        *({"retries": value} for value in (-1, None, 0.5, "1", False)),
        *({"calls_per_worker": value} for value in (0, -3, 2.0, "never", True)),
    )


@pytest.mark.parametrize(
    ("files", "cores"),
    [
        ({}, sys.maxsize),
        ({"cpu.max": "max 100000"}, sys.maxsize),
        ({"cpu.max": "150000 100000"}, 2),
        ({"cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"}, sys.maxsize),
        ({"cpu/cpu.cfs_quota_us": "50000", "cpu/cpu.cfs_period_us": "100000"}, 1),
    ],
)
def test_the_quota_of_a_container_limits_the_cores(
    files: dict[str, str], cores: int, tmp_path: Path
) -> None:
    (tmp_path / "cpu").mkdir()
    for name, text in files.items():
        (tmp_path / name).write_text(text + "\n")
    assert read_quota(tmp_path) == cores


def test_no_number_of_workers_means_the_cores_that_this_process_may_use() -> None:
    assert Processes(workers=0).workers == available_cores()
    assert instantiate({"_target_": "evoros.executor.processes.Processes", "workers": None}) == (
        Processes()
    )
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        assert Processes().workers == 1
    finally:
        os.sched_setaffinity(0, cores)


def test_as_many_calls_as_workers_run_at_the_same_time(pool: Pool, tmp_path: Path) -> None:
    here, there = str(tmp_path / "here"), str(tmp_path / "there")
    meetings = [pool.submit(meet, here, there), pool.submit(meet, there, here)]
    assert all(meeting.result(60) for meeting in meetings)


def test_numeric_libraries_get_one_thread_in_workers_and_keep_theirs_here(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "5")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    before = dict(os.environ)
    with Processes(workers=1).open() as pool:
        assert pool.submit(threads_of_numpy).result(60) == dict.fromkeys(ONE_THREAD, "1")
    assert dict(os.environ) == before


def test_a_fresh_process_takes_over_after_so_many_calls() -> None:
    with Processes(workers=1, calls_per_worker=2).open() as pool:
        ids = [pool.submit(process_id).result(60) for _ in range(5)]
    assert [ids.index(pid) for pid in ids] == [0, 0, 2, 2, 4]


def test_a_class_in_a_folder_on_the_path_reaches_the_workers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "users_own_part.py").write_text(
        "class Part:\n    def __init__(self, n):\n        self.n = n\n"
        "    def doubled(self):\n        return Part(2 * self.n)\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    part = __import__("users_own_part").Part(4)
    with Processes(workers=1).open() as pool:
        assert pool.submit(part.doubled).result(60).n == 8


@pytest.fixture
def no_process_left() -> Iterator[None]:
    before = set(children())  # the workers of ``pool``
    yield
    assert set(children()) <= before


@pytest.fixture
def tally(tmp_path: Path) -> str:
    return str(tmp_path / "tally")


@pytest.mark.usefixtures("no_process_left")
@pytest.mark.parametrize("reason", [None, KeyboardInterrupt, ValueError])
def test_leaving_waits_for_nothing_and_ends_everything(
    tmp_path: Path, reason: type[BaseException] | None
) -> None:
    tallies = [str(tmp_path / str(n)) for n in range(2)]
    futures = []
    with suppress(KeyboardInterrupt, ValueError), Processes(workers=2).open() as pool:
        futures += [pool.submit(hang_with_child, tally) for tally in tallies]
        futures += [pool.submit(square, n) for n in range(5)]
        assert wait_until(lambda: all(len(noted(tally)) == 3 for tally in tallies), 120)
        begin = time.monotonic()
        if reason is not None:
            raise reason
    assert time.monotonic() - begin < 60  # the calls would take five minutes
    assert not any(alive(pid) for pid in everyone(tallies))
    for future in futures:
        with pytest.raises(CancelledError):
            future.result(0)
    with pytest.raises(RuntimeError, match="closed"):
        pool.submit(square, 1)


@pytest.mark.usefixtures("no_process_left")
@pytest.mark.parametrize("delay_s", [0, 0.05, 0.2])
def test_workers_that_are_still_starting_end_too_and_in_silence(
    delay_s: float, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # A busy main process may pause between taking the locks away and ending the workers.
    take_locks: Callable[[Any], None] = WorkerManager.close_channels

    def take_locks_and_pause(manager: Any) -> None:
        take_locks(manager)
        time.sleep(0.3)

    monkeypatch.setattr(WorkerManager, "close_channels", take_locks_and_pause)
    with Processes(workers=2).open() as pool:
        future = pool.submit(square, 1)
        time.sleep(delay_s)
    assert future.done()
    assert capfd.readouterr() == ("", "")


@pytest.mark.usefixtures("no_process_left")
@pytest.mark.parametrize("leave", [False, True])
def test_a_program_in_a_session_of_its_own_ends_with_its_worker(tally: str, leave: bool) -> None:
    with Processes(workers=1, retries=0).open() as pool:
        done = pool.submit(start_and_leave, tally, leave)
        assert isinstance(done.exception(60), WorkerLost if leave else NoneType)
        assert wait_until(lambda: not leave or not any(map(alive, noted(tally))), 60)
    assert len(noted(tally)) == 1
    assert not any(map(alive, noted(tally)))


def test_a_cancelled_call_that_waited_is_never_made(tally: str) -> None:
    with Processes(workers=1).open() as pool:
        busy = pool.submit(meet, f"{tally} of busy", f"{tally} of test")
        waiting = pool.submit(note, tally)
        assert waiting.cancel()
        note(f"{tally} of test")
        assert pool.submit(square, 2).result(60) == 4
        assert busy.done()
    assert noted(tally) == []


SCRIPT = """
import sys, time
from pathlib import Path
sys.path.insert(0, {folder!r})
import executor_calls
from evoros.executor.processes import Processes

def main():
    with Processes(workers=2).open() as pool:
        for tally in {tallies!r}:
            pool.submit(executor_calls.hang_with_child, tally)
        print("started", flush=True)
        while True:
            time.sleep(0.1)

if __name__ == "__main__":
    main()
"""


def start_script(tmp_path: Path, tallies: Sequence[str]) -> "subprocess.Popen[str]":
    script = tmp_path / "script.py"
    folder = str(Path(executor_calls.__file__).parent)
    script.write_text(SCRIPT.format(folder=folder, tallies=list(tallies)))
    main = subprocess.Popen(
        [sys.executable, str(script)],
        start_new_session=True,  # its own group: Ctrl-C for it is not one for pytest
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert main.stdout is not None
    assert main.stdout.readline() == "started\n"
    return main


@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_workers_end_with_the_main_process_however_it_ends(
    tmp_path: Path, end: signal.Signals
) -> None:
    tallies = [str(tmp_path / str(n)) for n in range(2)]
    main = start_script(tmp_path, tallies)
    assert wait_until(lambda: len(everyone(tallies)) == 6, 120)
    os.kill(main.pid, end)
    assert wait_until(lambda: not any(alive(pid) for pid in everyone(tallies)), 60)
    main.communicate()


def test_ctrl_c_in_the_terminal_is_the_main_processs_alone(tmp_path: Path) -> None:
    for delay in (0.0, 0.1, 1.0):
        main = start_script(tmp_path, [])
        time.sleep(delay)
        os.killpg(main.pid, signal.SIGINT)  # what a terminal does, here amid the workers' start
        _, errors = main.communicate()
        assert errors.count("Traceback") == 1
        assert errors.rstrip().endswith("KeyboardInterrupt")


PROGRAM = """
from evoros.executor.processes import Processes
with Processes(workers=1).open() as pool:
    print(pool.submit(divmod, 17, 5).result(60))
"""


@pytest.mark.parametrize("how", ["-", "-c"])
def test_a_main_program_without_a_file_will_do(how: str, tmp_path: Path) -> None:
    command = [sys.executable, how] + ([PROGRAM] if how == "-c" else [])
    done = subprocess.run(command, input=PROGRAM, capture_output=True, text=True, cwd=tmp_path)
    assert (done.stdout, done.stderr) == ("(3, 2)\n", "")


def test_a_main_script_without_its_guard_is_told_of_it(tmp_path: Path) -> None:
    script = tmp_path / "unguarded.py"
    script.write_text(PROGRAM)
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True)
    assert done.returncode == 1
    last = done.stderr.rstrip().splitlines()[-1]
    assert last.startswith("evoros.base.errors.WorkerLost: divmod: lost 2 times")
    assert "if __name__ == '__main__'" in last
