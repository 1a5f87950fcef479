"""Tells when all processes of a mission are at rest. Standard library only; Linux.

From Linux 5.16 on, ``wchan`` names a place only while a thread waits there, and none from the time
at which it is woken. Before, its system call and then its state have to say so: the state alone
changes too early, while the thread may still turn back, and the call is still shown while a woken
thread is on its way to another CPU. And the CPU time of a process grows whenever one of its threads
leaves a CPU. So if each thread waits when it is looked at, and no CPU time has grown from before
the first look until after the last, then all waited before the first look: who ran then would have
had to leave its CPU, and who was woken would be running still. Nobody works on a message any more,
and nothing happens before the next message or the end of a wall-clock timeout.
"""

from __future__ import annotations

import ctypes
import os
import re
import resource
import struct
import threading
import time
from typing import NamedTuple

FIRST_PAUSE_S, LAST_PAUSE_S = 0.00002, 0.0002
TRIAL_LOOKS = 20
"""How often, at most, a thread is looked at that soon waits."""

# linux/prctl.h
SET_TIMER_SLACK, SET_SUBREAPER = 29, 36

# asm/unistd.h: futex, select, poll, epoll, recv, accept, wait, pause, sigtimedwait
_WAITING = {
    "x86_64": "202 23 270 7 271 232 281 441 45 47 299 43 288 61 247 34 128",
    "aarch64": "98 72 73 22 441 207 212 243 202 242 260 95 137",
}
WAITING = frozenset(_WAITING.get(os.uname().machine, "").encode().split())
"""The calls in which a thread waits for something outside of it, and never for a disk."""
# asm/unistd.h: clock_nanosleep, nanosleep
_SLEEPING = {"x86_64": "230 35", "aarch64": "115 101"}
CLOCK_SLEEP, SLEEP = _SLEEPING.get(os.uname().machine, "none none").encode().split()
UNTIL = 1  # linux/time.h: TIMER_ABSTIME
NOWHERE = b"0"  # in wchan
ENDED = (b"Z", b"X")  # in stat
SHORT_S = 0.001
"""Who sleeps for less is at work. Python's time.sleep(0), by which a publisher of rospy lets other
threads send, sleeps for as long as the kernel may delay timers, 50 us."""


class Files(NamedTuple):
    """The open files of a thread in /proc."""

    call: int
    state: int
    place: int  # where in the kernel it waits
    leads: bool  # its process, and stops with all threads of it


class Rest:
    """Watches all processes of a mission, and the threads of this one except the main thread."""

    def __init__(self, isolated: bool) -> None:
        """Watch what this process will start; call it before it starts anything.

        ``isolated``: the mission has a process namespace, everyone in which is watched.

        Raises:
            OSError: the kernel does not tell what is needed.
        """
        self._isolated = isolated
        self._files: dict[tuple[int, int], Files] = {}  # by process and thread
        self._clocks: list[int] = []  # of CPU time
        self._places: dict[tuple[int, int], bytes] = {}  # where a thread is known to wait
        self._working: tuple[int, int] | None = None  # the thread that was last seen at work
        self._tells_places = _tells_places()
        self._population: object = None  # for which these were drawn up
        self._newest = os.open("/proc/loadavg", os.O_RDONLY)
        # Who loses its parent becomes a child of this process, which may look at its descendants.
        ctypes.CDLL(None).prctl(SET_SUBREAPER, 1, 0, 0, 0)
        os.stat(f"/proc/self/task/{os.getpid()}/children")

    def wait(self, limit_s: float) -> bool:
        """Return when all rest: True; False if they still work after ``limit_s`` of wall time."""
        end = time.monotonic() + limit_s
        pause = 0.0
        while not self._at_rest():
            if time.monotonic() > end:
                return False
            time.sleep(pause)
            pause = min(pause + FIRST_PAUSE_S, LAST_PAUSE_S)
        return True

    def working(self) -> list[str]:
        """Return the processes that are not asleep at this moment, as their commands."""
        self._draw_up()
        pids = {
            pid for pid, tid in self._files if pid != os.getpid() and not self._waits((pid, tid))
        }
        return [_command(pid) for pid in sorted(pids)]

    def prepare(self) -> None:
        """Allow short pauses and many open files; call it after the start of all processes.

        The settings would be inherited.
        """
        ctypes.CDLL(None).prctl(SET_TIMER_SLACK, 1, 0, 0, 0)
        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))

    def _at_rest(self) -> bool:
        try:
            if self._working is not None and not self._waits(self._working):
                return False  # most often it is the same thread that works on
            if self._who() != self._population:
                self._draw_up()
            before = list(map(time.clock_gettime_ns, self._clocks))
            for thread in self._files:
                if not self._waits(thread):
                    self._working = thread
                    return False
            if not self._tells_places and not all(
                _sleeps(files.state) for files in self._files.values()
            ):
                return False
            after = list(map(time.clock_gettime_ns, self._clocks))
        except PermissionError as error:
            raise OSError(f"/proc shows no calls of nodes ({error}); allow tracing") from error
        except OSError:  # a thread or process has ended
            self._population = self._working = None
            return False
        return before == after and self._who() == self._population

    def _waits(self, thread: tuple[int, int]) -> bool:
        """Whether a thread waits for something outside of it, or has ended."""
        files = self._files[thread]
        if files.leads and not _sleeps(files.state):
            return False
        if self._tells_places:
            place = os.pread(files.place, 64, 0)
            if place == NOWHERE:
                return _state(files.state) in ENDED
            if place == self._places.get(thread):
                return True
        call, *arguments = _call(files)
        if call in WAITING:
            if self._tells_places:
                self._places[thread] = place
            return True
        if call in (CLOCK_SLEEP, SLEEP):
            return _sleeps_long(thread[0], call, arguments)
        # It may wait for a disk, or in a call that is not in the list.
        return call != b"running" and _sleeps(files.state) and call == _call(files)[0]

    def _who(self) -> object:
        """Return a value that changes whenever a process or thread of the mission begins."""
        if self._isolated:  # the number of the newest thread of this namespace
            return os.pread(self._newest, 128, 0).split()[-1]
        return frozenset(self._threads())

    def _draw_up(self) -> None:
        """Open the files of new threads, and close those of threads that have ended."""
        self._population, self._working = self._who(), None
        threads = self._threads()
        for thread in self._files.keys() - threads:
            self._places.pop(thread, None)
            for file in self._files.pop(thread)[:3]:
                os.close(file)
        for thread in threads - self._files.keys():
            files = _open(*thread)
            if files is not None:
                self._files[thread] = files
        me = os.getpid()
        # linux/posix-timers.h: how the CPU clock of a process and of a thread is numbered
        self._clocks = [~pid << 3 | 2 for pid in {pid for pid, _ in self._files} - {me}]
        self._clocks += [~tid << 3 | 6 for pid, tid in self._files if pid == me]

    def _threads(self) -> set[tuple[int, int]]:
        """Return the threads of all processes of the mission except this one's main thread."""
        me = os.getpid()
        threads: set[tuple[int, int]] = set()
        pids = [me]
        if self._isolated:
            pids = [int(name) for name in os.listdir("/proc") if name.isdigit()]
            pids = [pid for pid in pids if pid != 1 or me == 1]  # that one only waits for the end
        for pid in pids:  # which grows meanwhile
            for tid in _numbers(f"/proc/{pid}/task"):
                threads.add((pid, tid))
                if not self._isolated:
                    pids += _children(pid, tid)
        return threads - {(me, me)}


def _open(pid: int, tid: int) -> Files | None:
    """Open the files of a thread; None if it has ended."""
    opened: list[int] = []
    names = ("syscall", "stat", "wchan")
    try:
        opened.extend(os.open(f"/proc/{pid}/task/{tid}/{name}", os.O_RDONLY) for name in names)
    except (FileNotFoundError, ProcessLookupError):
        for file in opened:
            os.close(file)
        return None
    call, state, place = opened
    return Files(call, state, place, leads=pid == tid)


def _tells_places() -> bool:
    """Whether the kernel tells where a thread waits, and nothing of one that was woken.

    It does so from version 5.16 on, if it has the names of its functions.
    """
    version = re.match(r"(\d+)\.(\d+)", os.uname().release)
    if version is None or tuple(map(int, version.groups())) < (5, 16):
        return False
    done = threading.Event()
    thread = threading.Thread(target=done.wait, daemon=True)
    thread.start()
    told = False
    with open(f"/proc/self/task/{thread.native_id}/wchan", "rb") as file:
        for _ in range(TRIAL_LOOKS):
            time.sleep(LAST_PAUSE_S)
            told = told or os.pread(file.fileno(), 64, 0) not in (b"", NOWHERE)
    done.set()
    thread.join()
    return told


def _call(files: Files) -> list[bytes]:
    """Return the number and the arguments of a thread's call, or ``running``."""
    return os.pread(files.call, 192, 0).split()


def _sleeps_long(pid: int, call: bytes, arguments: list[bytes]) -> bool:
    """Whether a call that sleeps for a wall-clock time does so for long."""
    clock, flags, at = 0, 0, int(arguments[0], 16)
    if call == CLOCK_SLEEP:
        clock, flags, at = (int(argument, 16) for argument in arguments[:3])
    with open(f"/proc/{pid}/mem", "rb", buffering=0) as memory:  # another one after an exec
        seconds, nanoseconds = struct.unpack("qq", os.pread(memory.fileno(), 16, at))
    left: float = seconds + 1e-9 * nanoseconds
    return left - (time.clock_gettime(clock) if flags == UNTIL else 0.0) > SHORT_S


def _sleeps(state: int) -> bool:
    """Whether a thread sleeps or has ended; one that was stopped (T) does neither."""
    return _state(state) in (b"S", *ENDED)


def _state(file: int) -> bytes:
    text = os.pread(file, 128, 0)
    at = text.rindex(b")") + 2  # the name in brackets may contain anything
    return text[at : at + 1]


def _numbers(folder: str) -> list[int]:
    try:
        return [int(name) for name in os.listdir(folder)]
    except (FileNotFoundError, ProcessLookupError):  # ended meanwhile
        return []


def _children(pid: int, tid: int) -> list[int]:
    try:
        with open(f"/proc/{pid}/task/{tid}/children", "rb") as file:
            return [int(number) for number in file.read().split()]
    except (FileNotFoundError, ProcessLookupError):
        return []


def _command(pid: int) -> str:
    try:
        with open(f"/proc/{pid}/cmdline", "rb") as file:
            return file.read().replace(b"\0", b" ").decode(errors="replace").strip() or str(pid)
    except OSError:
        return str(pid)
