"""Tells when all processes of a mission are at rest. Standard library only; Linux.

From Linux 5.16 on, ``wchan`` names a place only while a thread waits there, and none from the time
at which it is woken. Before, its system call and then its state have to say so: the state alone
changes too early, while the thread may still turn back, and the call is still shown while a woken
thread is on its way to another CPU. And the CPU time of a process grows whenever one of its threads
leaves a CPU. So if each thread waits when it is looked at, and no CPU time has grown from before
the first look until after the last, then all waited before the first look: who ran then would have
had to leave its CPU, and who was woken would be running still. What was sent has arrived, because
the call that sends also delivers. What Linux leaves to a thread of its own instead, on a CPU that
had too much to do, is counted in softnet_stat. So nobody works on a message any more, and nothing
happens before the next message or the end of a wall-clock timeout.
"""

from __future__ import annotations

import ctypes
import os
import resource
import time
from contextlib import suppress

from .watched_thread import WatchedThread, tells_places

# A row of softnet_stat has numbers of eight digits for a CPU, of which the twelfth is its backlog.
SOFTNET_BYTES = 65536
BACKLOG, NO_PACKETS = slice(11 * 9, 11 * 9 + 8), b"00000000"
FIRST_PAUSE_S, LAST_PAUSE_S = 0.00002, 0.0002

# linux/prctl.h
SET_TIMER_SLACK, SET_SUBREAPER = 29, 36


class Hidden(Exception):
    """A process of the mission hides from this one."""

    def __init__(self, error: PermissionError) -> None:
        """``error``: on opening or reading a file of the process in /proc."""
        command = _command(int(str(error.filename).split("/")[2]))
        super().__init__(
            f"all processes must let evoros see what they wait for, unlike {command} ({error}); "
            f"run them as the user and with the capabilities of evoros"
        )


class Rest:
    """Watches all processes of a mission, and the threads of this one except the main thread."""

    def __init__(self, isolated: bool) -> None:
        """Watch what this process will start; call it before it starts anything.

        ``isolated``: the mission has a process namespace, everyone in which is watched.

        Raises:
            OSError: the kernel lacks a file that is needed.
        """
        self._isolated = isolated
        self._threads: list[WatchedThread] = []
        self._clocks: list[int] = []  # of CPU time
        self._working: WatchedThread | None = None  # the one that was last seen at work
        self._tells_places = tells_places()
        self._population: object = None  # for which these were drawn up
        self._newest = os.open("/proc/loadavg", os.O_RDONLY)
        self._packets = os.open("/proc/net/softnet_stat", os.O_RDONLY)
        # Who loses its parent becomes a child of this process, which may look at its descendants.
        ctypes.CDLL(None).prctl(SET_SUBREAPER, 1, 0, 0, 0)
        os.stat(f"/proc/self/task/{os.getpid()}/children")

    def wait(self, limit_s: float) -> bool:
        """Return when all rest: True; False if they still work after ``limit_s`` of wall time.

        Raises:
            Hidden: a process cannot be watched.
        """
        end = time.monotonic() + limit_s
        pause = 0.0
        while not self._at_rest():
            if time.monotonic() > end:
                return False
            time.sleep(pause)
            pause = min(pause + FIRST_PAUSE_S, LAST_PAUSE_S)
        return True

    def working(self) -> list[str]:
        """Return the processes that are not asleep at this moment, as their commands.

        Raises:
            Hidden: a process cannot be watched.
        """
        pids = set()
        try:
            self._draw_up()
            for thread in self._threads:
                with suppress(FileNotFoundError, ProcessLookupError):  # it has ended
                    if not thread.waits(self._tells_places):
                        pids.add(thread.pid)
        except PermissionError as error:
            raise Hidden(error) from error
        return [_command(pid) for pid in sorted(pids - {os.getpid()})]

    def prepare(self) -> None:
        """Allow short pauses and many open files; call it after the start of all processes.

        The settings would be inherited.
        """
        ctypes.CDLL(None).prctl(SET_TIMER_SLACK, 1, 0, 0, 0)
        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))

    def _at_rest(self) -> bool:
        try:
            if self._working is not None and not self._working.waits(self._tells_places):
                return False  # most often it is the same thread that works on
            if self._who() != self._population:
                self._draw_up()
            before = list(map(time.clock_gettime_ns, self._clocks))
            if self._packets_wait() or not self._all_wait() or self._packets_wait():
                return False
            after = list(map(time.clock_gettime_ns, self._clocks))
        except PermissionError as error:
            raise Hidden(error) from error
        except OSError:  # a thread or process has ended
            self._population = self._working = None
            return False
        return before == after and self._who() == self._population

    def _packets_wait(self) -> bool:
        """Whether packets, of anybody, wait to be delivered; from Linux 5.10 on, which tells it."""
        rows = os.pread(self._packets, SOFTNET_BYTES, 0).splitlines()
        return any(row[BACKLOG] not in (b"", NO_PACKETS) for row in rows)

    def _all_wait(self) -> bool:
        """Look at each thread once, first at those that worked last; most are where they wait."""
        for place, thread in enumerate(self._threads):
            if not thread.waits(self._tells_places):
                self._working = thread
                self._threads.insert(0, self._threads.pop(place))
                return False
        return True

    def _who(self) -> object:
        """Return a value that changes whenever a process or thread of the mission begins."""
        if self._isolated:  # the number of the newest thread of this namespace
            return os.pread(self._newest, 128, 0).split()[-1]
        return frozenset(self._list_threads())

    def _draw_up(self) -> None:
        """Open the files of new threads, and close the files of ended ones."""
        self._population, self._working = self._who(), None
        numbers = self._list_threads()
        known = {thread.numbers for thread in self._threads}
        for thread in self._threads:
            if thread.numbers not in numbers:
                thread.close()
        self._threads = [thread for thread in self._threads if thread.numbers in numbers]
        for pid, tid in numbers - known:
            with suppress(FileNotFoundError, ProcessLookupError):  # it has ended
                self._threads.append(WatchedThread(pid, tid))
        me = os.getpid()
        # linux/posix-timers.h: how the CPU clock of a process and of a thread is numbered
        self._clocks = [~pid << 3 | 2 for pid in {thread.pid for thread in self._threads} - {me}]
        self._clocks += [~thread.tid << 3 | 6 for thread in self._threads if thread.pid == me]

    def _list_threads(self) -> set[tuple[int, int]]:
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


def _numbers(folder: str) -> list[int]:
    try:
        return list(map(int, os.listdir(folder)))
    except (FileNotFoundError, ProcessLookupError):  # ended meanwhile
        return []


def _children(pid: int, tid: int) -> list[int]:
    try:
        with open(f"/proc/{pid}/task/{tid}/children", "rb") as file:
            return list(map(int, file.read().split()))
    except (FileNotFoundError, ProcessLookupError):
        return []


def _command(pid: int) -> str:
    try:
        with open(f"/proc/{pid}/cmdline", "rb") as file:
            return file.read().replace(b"\0", b" ").decode(errors="replace").strip() or str(pid)
    except OSError:
        return str(pid)
