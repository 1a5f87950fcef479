"""No worker outlives its pool or the main process, however they end."""

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
from executor_calls import (
    alive,
    children,
    everyone,
    hang_with_child,
    meet,
    note,
    noted,
    square,
    start_and_leave,
    wait_until,
)
from pebble.pool.process import WorkerManager

from evoros.base.errors import WorkerLost
from evoros.executor.processes import Processes

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="finds processes in /proc")


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
    """Also if the worker crashes before."""
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
