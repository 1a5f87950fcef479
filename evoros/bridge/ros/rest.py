"""Tells when all processes of a mission are at rest. Standard library only; Linux.

A thread that is woken counts as runnable before the call that woke it returns, and the CPU time of
a process grows with each run of one of its threads. If all threads sleep, each at the moment when
it is looked at, and no CPU time has grown from before the first look until after the last, then all
slept before the first look: who ran then would have had to stop before it was looked at, and who
was runnable would still be. So nobody works on a message any more, and nothing happens before the
next message or the end of a wall-clock timeout.
"""

from __future__ import annotations

import ctypes
import os
import resource
import time

FIRST_PAUSE_S, LAST_PAUSE_S = 0.00002, 0.0002

# linux/prctl.h
SET_TIMER_SLACK, SET_SUBREAPER = 29, 36


class Rest:
    """Watches all processes of a mission, and the threads of this one except the main thread."""

    def __init__(self, isolated: bool) -> None:
        """Watch what this process will start; call it before it starts anything.

        ``isolated``: the mission has a process namespace, everyone in which is watched.

        Raises:
            OSError: the kernel does not tell what is needed.
        """
        self._isolated = isolated
        self._states: dict[tuple[int, int], int] = {}  # open files, by process and thread
        self._clocks: list[int] = []  # of CPU time
        self._population: object = None  # for which these were drawn up
        self._newest = os.open("/proc/loadavg", os.O_RDONLY)
        if not isolated:  # who loses its parent becomes a child of this process, and stays in sight
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
            pid
            for (pid, _), file in self._states.items()
            if pid != os.getpid() and not _asleep(file)
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
        population = self._who()
        if population != self._population:
            self._draw_up()
        try:
            before = list(map(time.clock_gettime_ns, self._clocks))
            if not all(map(_asleep, self._states.values())):
                return False
            after = list(map(time.clock_gettime_ns, self._clocks))
        except OSError:  # a thread or process has ended
            self._population = None
            return False
        return before == after and self._who() == self._population

    def _who(self) -> object:
        """Return a value that changes whenever a process or thread of the mission begins."""
        if self._isolated:  # the number of the newest thread of this namespace
            return os.pread(self._newest, 128, 0).split()[-1]
        return frozenset(self._threads())

    def _draw_up(self) -> None:
        """Open the files of new threads, and close those of threads that have ended."""
        self._population = self._who()
        threads = self._threads()
        for thread in self._states.keys() - threads:
            os.close(self._states.pop(thread))
        for pid, tid in threads - self._states.keys():
            try:
                self._states[pid, tid] = os.open(f"/proc/{pid}/task/{tid}/stat", os.O_RDONLY)
            except (FileNotFoundError, ProcessLookupError):  # ended meanwhile
                continue
        me = os.getpid()
        # linux/posix-timers.h: how the CPU clock of a process and of a thread is numbered
        self._clocks = [~pid << 3 | 2 for pid in {pid for pid, _ in self._states} - {me}]
        self._clocks += [~tid << 3 | 6 for pid, tid in self._states if pid == me]

    def _threads(self) -> set[tuple[int, int]]:
        """Return the threads of all processes of the mission except this one's main thread."""
        me = os.getpid()
        threads: set[tuple[int, int]] = set()
        pids = [int(name) for name in os.listdir("/proc") if name.isdigit()]
        pids = pids if self._isolated else [me]
        for pid in pids:  # which grows meanwhile
            for tid in _numbers(f"/proc/{pid}/task"):
                threads.add((pid, tid))
                if not self._isolated:
                    pids += _children(pid, tid)
        return threads - {(me, me)}


def _asleep(file: int) -> bool:
    """Whether the thread of a stat file sleeps, or has ended; a stopped one (T) does neither."""
    text = os.pread(file, 128, 0)
    at = text.rindex(b")") + 2  # the name in brackets may contain anything
    return text[at : at + 1] in b"SZX"


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
