"""Tells when all processes of a mission are at rest. Standard library only; Linux.

A thread that is woken is runnable before the call that woke it returns, and the kernel counts how
often each thread began to run. If every thread sleeps in two looks, and none began to run from
before the first until after the second, then between the looks all slept at once. Nobody works on
a message any more, and nothing happens before the next message or the end of a wall-clock timeout.
"""

from __future__ import annotations

import ctypes
import os
import resource
import time
from typing import NamedTuple

ASLEEP = (b"S", b"Z", b"X")  # sleeping, or ended; a stopped process (T) is not at rest
FIRST_PAUSE_S, LAST_PAUSE_S = 0.00002, 0.0002

# linux/prctl.h
SET_TIMER_SLACK, SET_SUBREAPER = 29, 36


class Files(NamedTuple):
    """The open files of one thread in /proc."""

    runs: int
    state: int


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
        self._population: object = None  # for which _files was drawn up
        self._newest = os.open("/proc/loadavg", os.O_RDONLY)
        if not isolated:  # who loses its parent becomes a child of this process, and stays in sight
            ctypes.CDLL(None).prctl(SET_SUBREAPER, 1, 0, 0, 0)
        with open("/proc/thread-self/schedstat", "rb") as file:
            if file.read().split()[2] == b"0":
                raise OSError("this kernel does not count how often a thread runs")

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
            for (pid, _), files in self._files.items()
            if pid != os.getpid() and self._state(files) not in ASLEEP
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
        """Look twice; the order of the four rows of reads is what makes the answer certain."""
        population = self._who()
        if population != self._population:
            self._draw_up()
        files = list(self._files.values())
        try:
            before = [os.pread(each.runs, 64, 0).split()[2] for each in files]
            if not all(self._state(each) in ASLEEP for each in files):
                return False
            if not all(self._state(each) in ASLEEP for each in files):
                return False
            after = [os.pread(each.runs, 64, 0).split()[2] for each in files]
        except ProcessLookupError:  # a thread has ended
            self._population = None
            return False
        return before == after and self._who() == self._population

    @staticmethod
    def _state(files: Files) -> bytes:
        text = os.pread(files.state, 128, 0)
        at = text.rindex(b")") + 2  # the name in brackets may contain anything
        return text[at : at + 1]

    def _who(self) -> object:
        """Return a value that changes whenever a process or thread of the mission begins."""
        if self._isolated:  # the number of the newest thread of this namespace
            return os.pread(self._newest, 128, 0).split()[-1]
        return frozenset(self._threads())

    def _draw_up(self) -> None:
        """Open the files of new threads, and close those of threads that have ended."""
        self._population = self._who()
        threads = self._threads()
        for thread in self._files.keys() - threads:
            for file in self._files.pop(thread):
                os.close(file)
        for pid, tid in threads - self._files.keys():
            path = f"/proc/{pid}/task/{tid}/"
            try:
                state = os.open(path + "stat", os.O_RDONLY)
            except (FileNotFoundError, ProcessLookupError):  # ended meanwhile
                continue
            try:
                runs = os.open(path + "schedstat", os.O_RDONLY)
            except (FileNotFoundError, ProcessLookupError):
                os.close(state)
                continue
            self._files[pid, tid] = Files(runs, state)

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
