"""Calls for the tests of executors. Workers import this module, which therefore imports little."""

import ctypes
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from evoros.executor.protocol import ONE_THREAD

LONG_S = 300.0


def square(x: int) -> int:
    return x * x


def die(tally: str, how: int) -> None:
    note(tally)
    if how < 0:
        os.kill(os.getpid(), -how)
    os._exit(how)


def start_and_leave(tally: str, leave: bool) -> None:
    """Start a program that has left the session, and whose own parent has ended."""
    script = (
        f"import subprocess\nprocess = subprocess.Popen(['sleep', '{LONG_S}'])\n"
        f"open({tally!r}, 'a').write(f'{{process.pid}}\\n')"
    )
    subprocess.run([sys.executable, "-c", script], start_new_session=True, check=True)
    if leave:
        os.kill(os.getpid(), signal.SIGKILL)


def leave(tally: str, code: int) -> None:
    note(tally)
    os._exit(code)


def segfault(tally: str) -> None:
    note(tally)
    ctypes.string_at(0)


def wait_for(file: str) -> str:
    """Return the name of a file once it is there."""
    while not Path(file).exists():
        time.sleep(0.01)
    return file


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
    start_and_leave(tally, leave=False)
    hang_in_c(tally)


def die_at_first(tally: str) -> str:
    note(tally)
    if len(noted(tally)) == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return "survived"


def sleep_at_first(tally: str) -> str:
    note(tally)
    if len(noted(tally)) == 1:
        time.sleep(LONG_S)
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
    return wait_until(lambda: bool(noted(other)), 120)


def kill_worker(tally: str) -> None:
    """Kill the worker of the cluster whose process this is."""
    note(tally)
    os.kill(worker_of_cluster(), signal.SIGKILL)
    time.sleep(LONG_S)


def kill_companion(tally: str) -> None:
    """Kill the process of evoros beside the worker of the cluster, and this one with it."""
    note(tally)
    os.kill(os.getppid(), signal.SIGKILL)
    time.sleep(LONG_S)


def worker_of_cluster() -> int:
    """The worker of a cluster is the parent of the companion, whose child this process is."""
    stat = Path(f"/proc/{os.getppid()}/stat").read_text()
    return int(stat.rpartition(")")[2].split()[1])


# What calls leave behind, and the processes of this machine.


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
    processes = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(stat.read_text().rpartition(")")[2].split()[1])
            tracker = b"resource_tracker" in (stat.parent / "cmdline").read_bytes()
        except (FileNotFoundError, ProcessLookupError):
            continue
        if parent == os.getpid() and not tracker and alive(int(stat.parent.name)):
            processes.append(int(stat.parent.name))
    return processes


def list_group(leader: int) -> list[int]:
    """Living processes of a group; killpg would count those that nobody has reaped."""
    members = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(FileNotFoundError, ProcessLookupError):
            if int(stat.read_text().rpartition(")")[2].split()[2]) == leader:
                members.append(int(stat.parent.name))
    return [member for member in members if alive(member)]


def wait_until(condition: Callable[[], bool], limit_s: float = 100.0) -> bool:
    end = time.monotonic() + limit_s
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return condition()
