"""Executors under real faults: crashes, hangs, a killed main process, Ctrl-C."""

import ctypes
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from helpers import ROOT
from hydra.utils import instantiate
from omegaconf import OmegaConf
from pebble.pool.process import WorkerManager

from evoros.base import resources as assets
from evoros.base.errors import EvorosError, InputError, WorkerLost
from evoros.executor.processes import ONE_THREAD, Processes, available_cores
from evoros.executor.protocol import Executor, Pool
from evoros.executor.serial import Serial

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="finds processes in /proc")

CONFIGURATIONS = sorted((assets.bundled_folder("conf") / "executor").glob("*.yaml"))
LONG_S = 300.0


# ---- the calls: all at the top level, because workers import them


def square(x: int) -> int:
    return x * x


def die(tally: str, how: int) -> None:
    note(tally)
    if how < 0:
        os.kill(os.getpid(), -how)
    os._exit(how)


def segfault(tally: str) -> None:
    note(tally)
    ctypes.string_at(0)


def sleep_long(tally: str) -> None:
    note(tally)
    time.sleep(LONG_S)


def hang_in_c(tally: str) -> None:
    """Never returns to the interpreter, and never lets another thread of it run."""
    note(tally)
    re.match(r"(a*)*b", "a" * 64)


def hang_with_child(tally: str) -> None:
    child = subprocess.Popen(["sleep", str(LONG_S)])
    note(tally, child.pid)
    hang_in_c(tally)


def die_at_first(tally: str) -> str:
    note(tally)
    if len(noted(tally)) == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return "survived"


def fail(tally: str, error: type[Exception]) -> None:
    note(tally)
    raise error("as it is", 7)


class ParticularError(Exception):
    """Pickles, but cannot be rebuilt: __init__ wants more than ``args``."""

    def __init__(self, text: str, number: int) -> None:
        super().__init__(text)


class HomeOnly:
    """Pickles in the main process, but a worker finds no such class."""

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str, str]]:
        return find, (__name__, "NoSuchClass")


def find(module: str, name: str) -> Any:
    return getattr(sys.modules[module], name)


def make_unpicklable() -> object:
    return lambda: None


def threads_of_numpy() -> dict[str, str | None]:
    return {name: os.environ.get(name) for name in ONE_THREAD}


def process_id() -> int:
    return os.getpid()


def meet(mine: str, other: str) -> bool:
    note(mine)
    return wait_until(lambda: bool(noted(other)), 20)


# ---- helpers


def note(tally: str, pid: int | None = None) -> None:
    with Path(tally).open("a") as file:
        file.write(f"{pid or os.getpid()}\n")


def noted(tally: str | Path) -> list[int]:
    path = Path(tally)
    return [int(line) for line in path.read_text().splitlines()] if path.exists() else []


def everyone(tallies: Sequence[str]) -> list[int]:
    return [pid for tally in tallies for pid in noted(tally)]


def alive(pid: int) -> bool:
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return stat.rpartition(")")[2].split()[0] != "Z"


def children() -> list[int]:
    """Living children of this process but Python's own resource tracker."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(stat.read_text().rpartition(")")[2].split()[1])
            tracker = b"resource_tracker" in (stat.parent / "cmdline").read_bytes()
        except (FileNotFoundError, ProcessLookupError):
            continue
        if parent == os.getpid() and not tracker and alive(int(stat.parent.name)):
            found.append(int(stat.parent.name))
    return found


def wait_until(condition: Callable[[], bool], limit_s: float) -> bool:
    end = time.monotonic() + limit_s
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return condition()


@pytest.fixture(scope="module")
def pool() -> Iterator[Pool]:
    with Processes(workers=2, retries=1, time_limit_s=60).open() as pool:
        yield pool


@pytest.fixture
def no_process_left() -> Iterator[None]:
    before = set(children())  # the workers of ``pool``
    yield
    assert set(children()) <= before


@pytest.fixture
def tally(tmp_path: Path) -> str:
    return str(tmp_path / "tally")


# ---- every part of the group


@pytest.mark.parametrize("path", CONFIGURATIONS, ids=lambda path: path.stem)
def test_each_configuration_builds_an_executor_that_computes(path: Path) -> None:
    configuration = OmegaConf.load(path)
    executor = instantiate(configuration, _convert_="all")
    assert isinstance(executor, Executor)
    assert {"_target_", *vars(executor)} == set(configuration)
    assert executor.workers >= 1
    with executor.open() as pool:
        assert pool.submit(square, 7).result() == 49
        with pytest.raises(ZeroDivisionError):
            pool.submit(divmod, 1, 0).result()


@pytest.mark.parametrize("executor", [Processes(workers=1), Processes(workers=3), Serial()])
def test_results_are_those_of_plain_calls_in_the_order_of_submission(executor: Executor) -> None:
    with executor.open() as pool:
        futures = [pool.submit(square, n) for n in range(40)]
        assert [future.result() for future in futures] == [square(n) for n in range(40)]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        *[("workers", value) for value in (-1, 1.0, "all", True, float("nan"))],
        *[("time_limit_s", value) for value in (0, -1, None, "10", float("inf"), True)],
        *[("retries", value) for value in (-1, None, 0.5, "1", False)],
        *[("calls_per_worker", value) for value in (0, -3, 2.0, "never", True)],
    ],
)
def test_a_bad_value_is_refused_in_one_line_that_names_it(key: str, value: object) -> None:
    with pytest.raises(InputError) as refusal:
        Processes(**{key: value})  # type: ignore[arg-type]
    text = str(refusal.value)
    assert "\n" not in text
    assert f"Processes.{key}: must be" in text
    assert repr(value) in text


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


# ---- crashes and hangs


FAULTS: dict[str, tuple[Callable[..., Any], tuple[object, ...], str]] = {
    "killed": (die, (-signal.SIGKILL,), "signal 9"),
    "aborted": (die, (-signal.SIGABRT,), "signal 6"),
    "exits": (die, (3,), "exit code 3"),
    "segfault": (segfault, (), "signal 11"),
    "sleeps": (sleep_long, (), "time_limit_s = 2 s"),
    "hangs in C": (hang_in_c, (), "time_limit_s = 2 s"),
}


@pytest.mark.usefixtures("no_process_left")
@pytest.mark.parametrize("workers", [1, 3])
def test_faults_cost_only_the_calls_that_have_them(tmp_path: Path, workers: int) -> None:
    retries = int(workers > 1)
    with Processes(workers=workers, time_limit_s=2, retries=retries).open() as pool:
        healthy, faulty = [], {}
        for number, (name, (function, arguments, _)) in enumerate(FAULTS.items()):
            healthy.append(pool.submit(square, number))
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
            assert len(attempts) == retries + 1
            assert not any(alive(pid) for pid in attempts)


def test_a_call_that_crashes_once_succeeds_at_its_second_attempt(pool: Pool, tally: str) -> None:
    assert pool.submit(die_at_first, tally).result(60) == "survived"
    assert len(set(noted(tally))) == 2


def test_a_worker_that_is_killed_while_idle_costs_no_call() -> None:
    with Processes(workers=1, retries=1).open() as pool:
        first = pool.submit(process_id).result(60)
        os.kill(first, signal.SIGKILL)
        time.sleep(0.3)  # longer than Pebble takes to see it
        assert pool.submit(process_id).result(60) != first


# ---- what the function itself raises or returns


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
    with pytest.raises(InputError, match="cannot be sent"):
        pool.submit(lambda: None)
    with pytest.raises(EvorosError, match="ParticularError: as it is; this cannot be sent back"):
        pool.submit(fail, tally, ParticularError).result(60)
    with pytest.raises(EvorosError, match=r"function: .*cannot be sent back"):
        pool.submit(make_unpicklable).result(60)
    with pytest.raises(AttributeError, match="NoSuchClass"):
        pool.submit(repr, HomeOnly()).result(60)
    assert pool.submit(square, 3).result(60) == 9


# ---- what workers are


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


# ---- ends


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
        assert wait_until(lambda: all(len(noted(tally)) == 2 for tally in tallies), 30)
        begin = time.monotonic()
        if reason is not None:
            raise reason
    assert time.monotonic() - begin < 3
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


def test_a_cancelled_call_that_waited_is_never_made(tally: str) -> None:
    with Processes(workers=1).open() as pool:
        busy = pool.submit(time.sleep, 0.3)
        waiting = pool.submit(note, tally)
        assert waiting.cancel()
        assert pool.submit(square, 2).result(60) == 4
        assert busy.done()
    assert noted(tally) == []


SCRIPT = """
import sys, time
from pathlib import Path
sys.path.insert(0, {tests!r})
import test_executor
from evoros.executor.processes import Processes

def main():
    with Processes(workers=2).open() as pool:
        for tally in {tallies!r}:
            pool.submit(test_executor.hang_with_child, tally)
        print("started", flush=True)
        while True:
            time.sleep(0.1)

if __name__ == "__main__":
    main()
"""


def start_script(tmp_path: Path, tallies: Sequence[str]) -> "subprocess.Popen[str]":
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(tests=str(ROOT / "tests" / "executor"), tallies=list(tallies)))
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
    assert wait_until(lambda: len(everyone(tallies)) == 4, 30)
    os.kill(main.pid, end)
    assert wait_until(lambda: not any(alive(pid) for pid in everyone(tallies)), 20)
    main.communicate(timeout=20)


def test_ctrl_c_in_the_terminal_is_the_main_processs_alone(tmp_path: Path) -> None:
    for delay in (0.0, 0.1, 1.0):
        main = start_script(tmp_path, [])
        time.sleep(delay)
        os.killpg(main.pid, signal.SIGINT)  # what a terminal does, here amid the workers' start
        _, errors = main.communicate(timeout=20)
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
    done = subprocess.run(
        command, input=PROGRAM, capture_output=True, text=True, cwd=tmp_path, timeout=60
    )
    assert (done.stdout, done.stderr) == ("(3, 2)\n", "")


def test_a_main_script_without_its_guard_is_told_of_it(tmp_path: Path) -> None:
    script = tmp_path / "unguarded.py"
    script.write_text(PROGRAM)
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    last = done.stderr.rstrip().splitlines()[-1]
    assert last.startswith("evoros.base.errors.WorkerLost: divmod: lost 2 times")
    assert "if __name__ == '__main__'" in last
