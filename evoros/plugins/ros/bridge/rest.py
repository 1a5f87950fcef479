"""Detects that all processes of a mission are at rest, with only Linux and the standard library.

From Linux 5.16 on, ``wchan`` names the kernel function in which a thread waits, until the thread is
woken. On older kernels, the system call is read first and the state second: the state alone changes
too early, and the system call remains visible while a woken thread moves to another CPU.

The CPU time of a process grows whenever one of its threads leaves a CPU. If each thread waits when
checked, and the CPU times before the first and after the last check are equal, then all threads
were waiting before the first check. Sent messages have then arrived, because the sending call also
delivers them; deliveries deferred to a kernel thread are counted in softnet_stat.
"""

from __future__ import annotations

import ctypes
import os
import re
import resource
import struct
import threading
import time
from contextlib import suppress

# asm/unistd.h: clock_nanosleep, nanosleep. Threads at rest may also sleep, as in rospy.spin(), so
# the duration of a sleep must be known; it is stored only in the thread's memory.
_SLEEPING = {"x86_64": "230 35", "aarch64": "115 101"}
CLOCK_SLEEP, SLEEP = _SLEEPING.get(os.uname().machine, "none none").encode().split()
UNTIL = 1  # linux/time.h: TIMER_ABSTIME
NOWHERE = b"0"  # value of wchan for a running thread
ASLEEP, ENDED = b"S", (b"Z", b"X")  # states in stat
UNTOLD = b"0 0 0\n"  # content of schedstat on a kernel without statistics
PLACE_BYTES = 64  # maximum length of a kernel function name
SHORT_S = 0.001  # sleep [s] below which a thread is busy; time.sleep(0) in rospy lasts 50 us
TRIAL_LOOKS, TRIAL_PAUSE_S = 20, 0.0002  # maximum checks of a thread about to wait, and pause [s]

# Each row of softnet_stat has eight-digit numbers for one CPU; the twelfth is the backlog.
SOFTNET_BYTES = 65536
BACKLOG, NO_PACKETS = slice(11 * 9, 11 * 9 + 8), b"00000000"
FIRST_PAUSE_S, LAST_PAUSE_S = 0.00002, 0.0002

# linux/prctl.h
SET_TIMER_SLACK, SET_SUBREAPER = 29, 36


class WatchedThread:
    """The open /proc files of a thread, and their contents when last read."""

    def __init__(self, pid: int, tid: int) -> None:
        """Open the files; raise FileNotFoundError or ProcessLookupError if it has exited."""
        self.pid, self.tid = pid, tid
        self._files: list[int] = []
        try:
            for name in ("wchan", "syscall", "stat", "schedstat"):
                self._files.append(os.open(f"/proc/{pid}/task/{tid}/{name}", os.O_RDONLY))
        except OSError:
            self.close()
            raise
        self._place, self._call, self._state, self._runs = self._files
        self._known_place = b""  # kernel function in which the thread last waited
        # content of schedstat during a sleep, and end of the sleep by time.monotonic()
        self._sleep: tuple[bytes, float] = (UNTOLD, 0.0)

    @property
    def numbers(self) -> tuple[int, int]:
        """The process id and the thread id."""
        return self.pid, self.tid

    def close(self) -> None:
        """Close the files."""
        for file in self._files:
            os.close(file)

    def waits(self, tells_places: bool) -> bool:
        """Return True if the thread is waiting for an external event or has exited."""
        place = os.pread(self._place, PLACE_BYTES, 0) if tells_places else b""
        if place and place == self._known_place:
            return True
        runs = os.pread(self._runs, 128, 0)
        if place not in (b"", NOWHERE) and runs == self._sleep[0]:
            return self._sleep[1] - time.monotonic() > SHORT_S  # the thread has not run since
        call, *arguments = self._read_call()
        state = self._read_state()
        if state != ASLEEP or place == NOWHERE or call == b"running":  # includes stopped threads
            return state in ENDED
        if call in (CLOCK_SLEEP, SLEEP):
            left = self._sleeps_for(call, arguments)
            if self._read_call() != [call, *arguments]:  # the memory may have changed
                return False
            self._sleep = (runs if runs != UNTOLD else b"", time.monotonic() + left)
            return left > SHORT_S
        self._known_place = place
        return True

    def _sleeps_for(self, call: bytes, arguments: list[bytes]) -> float:
        clock, flags, at = 0, 0, int(arguments[0], 16)
        if call == CLOCK_SLEEP:
            clock, flags, at = (int(argument, 16) for argument in arguments[:3])
        # The file is opened each time, because an exec replaces the memory.
        with open(f"/proc/{self.pid}/mem", "rb", buffering=0) as memory:
            seconds, nanoseconds = struct.unpack("qq", os.pread(memory.fileno(), 16, at))
        left: float = seconds + 1e-9 * nanoseconds
        return left - (time.clock_gettime(clock) if flags == UNTIL else 0.0)

    def _read_call(self) -> list[bytes]:
        """Return the number and arguments of the thread's system call, or ``running``."""
        try:
            return os.pread(self._call, 192, 0).split()
        except PermissionError as error:
            error.filename = f"/proc/{self.pid}/task/{self.tid}/syscall"
            raise

    def _read_state(self) -> bytes:
        text = os.pread(self._state, 128, 0)
        at = text.rindex(b")") + 2  # the name in parentheses may contain any character
        return text[at : at + 1]


def tells_places() -> bool:
    """Return True if the kernel (5.16 or later) reports the function in which a thread sleeps."""
    version = re.match(r"(\d+)\.(\d+)", os.uname().release)
    if version is None or tuple(map(int, version.groups())) < (5, 16):
        return False
    done = threading.Event()
    thread = threading.Thread(target=done.wait, daemon=True)
    thread.start()
    told = False
    with open(f"/proc/self/task/{thread.native_id}/wchan", "rb") as file:
        for _ in range(TRIAL_LOOKS):
            time.sleep(TRIAL_PAUSE_S)
            told = told or os.pread(file.fileno(), PLACE_BYTES, 0) not in (b"", NOWHERE)
    done.set()
    thread.join()
    return told


class Hidden(Exception):
    """This process lacks permission to observe a process of the mission."""

    def __init__(self, error: PermissionError) -> None:
        """Describe a PermissionError for one of a process's /proc files."""
        command = _command(int(str(error.filename).split("/")[2]))
        super().__init__(
            f"cannot read what the process {command} is waiting for ({error}); run all processes "
            "as the same user and with the same capabilities as evoros"
        )


class Rest:
    """Observes all processes of a mission, and all threads of this process but the main thread."""

    def __init__(self, isolated: bool) -> None:
        """Observe child processes started later or, if ``isolated``, the process namespace."""
        self._isolated = isolated
        self._threads: list[WatchedThread] = []
        self._clocks: list[int] = []  # CPU-time clocks
        self._working: WatchedThread | None = None  # thread that was busy at the last check
        self._tells_places = tells_places()
        self._population: object = None  # value of ``_who`` when the threads were listed
        self._newest = os.open("/proc/loadavg", os.O_RDONLY)
        self._packets = os.open("/proc/net/softnet_stat", os.O_RDONLY)
        # Orphans become children of this process, which may observe its descendants.
        ctypes.CDLL(None).prctl(SET_SUBREAPER, 1, 0, 0, 0)
        os.stat(f"/proc/self/task/{os.getpid()}/children")

    def wait(self, limit_s: float) -> bool:
        """Return True once all processes are at rest, or False after ``limit_s`` [s]."""
        end = time.monotonic() + limit_s
        pause = 0.0
        while not self._at_rest():
            if time.monotonic() > end:
                return False
            time.sleep(pause)
            pause = min(pause + FIRST_PAUSE_S, LAST_PAUSE_S)
        return True

    def working(self) -> list[str]:
        """Return the commands of the busy processes."""
        pids = set()
        try:
            self._draw_up()
            for thread in self._threads:
                with suppress(FileNotFoundError, ProcessLookupError):  # the thread has exited
                    if not thread.waits(self._tells_places):
                        pids.add(thread.pid)
        except PermissionError as error:
            raise Hidden(error) from error
        return [_command(pid) for pid in sorted(pids - {os.getpid()})]

    def prepare(self) -> None:
        """Allow short pauses and many open files; processes started later would inherit this."""
        ctypes.CDLL(None).prctl(SET_TIMER_SLACK, 1, 0, 0, 0)
        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))

    def _at_rest(self) -> bool:
        try:
            if self._working is not None and not self._working.waits(self._tells_places):
                return False  # usually the same thread is still busy
            if self._who() != self._population:
                self._draw_up()
            before = list(map(time.clock_gettime_ns, self._clocks))
            if self._packets_wait() or not self._all_wait() or self._packets_wait():
                return False
            after = list(map(time.clock_gettime_ns, self._clocks))
        except PermissionError as error:
            raise Hidden(error) from error
        except OSError:  # a thread or process has exited
            self._population = self._working = None
            return False
        return before == after and self._who() == self._population

    def _packets_wait(self) -> bool:
        """Return True if packets of any process await delivery; requires Linux 5.10."""
        rows = os.pread(self._packets, SOFTNET_BYTES, 0).splitlines()
        return any(row[BACKLOG] not in (b"", NO_PACKETS) for row in rows)

    def _all_wait(self) -> bool:
        """Return True if all threads are waiting; check the most recently busy ones first."""
        for place, thread in enumerate(self._threads):
            if not thread.waits(self._tells_places):
                self._working = thread
                self._threads.insert(0, self._threads.pop(place))
                return False
        return True

    def _who(self) -> object:
        """Return a value that changes whenever a process or thread of the mission starts."""
        if self._isolated:  # number of the newest thread in the namespace
            return os.pread(self._newest, 128, 0).split()[-1]
        return frozenset(self._list_threads())

    def _draw_up(self) -> None:
        """Open the files of new threads, and close the files of exited threads."""
        self._population, self._working = self._who(), None
        numbers = self._list_threads()
        known = {thread.numbers for thread in self._threads}
        for thread in self._threads:
            if thread.numbers not in numbers:
                thread.close()
        self._threads = [thread for thread in self._threads if thread.numbers in numbers]
        for pid, tid in numbers - known:
            with suppress(FileNotFoundError, ProcessLookupError):  # the thread has ended
                self._threads.append(WatchedThread(pid, tid))
        me = os.getpid()
        # linux/posix-timers.h: CPU clock ids of a process and a thread
        self._clocks = [~pid << 3 | 2 for pid in {thread.pid for thread in self._threads} - {me}]
        self._clocks += [~thread.tid << 3 | 6 for thread in self._threads if thread.pid == me]

    def _list_threads(self) -> set[tuple[int, int]]:
        """Return all threads of the mission's processes except the main thread of this process."""
        me = os.getpid()
        threads: set[tuple[int, int]] = set()
        pids = [me]
        if self._isolated:
            pids = [int(name) for name in os.listdir("/proc") if name.isdigit()]
            pids = [pid for pid in pids if pid != 1 or me == 1]  # init only waits
        for pid in pids:  # grows during the loop
            for tid in _numbers(f"/proc/{pid}/task"):
                threads.add((pid, tid))
                if not self._isolated:
                    pids += _children(pid, tid)
        return threads - {(me, me)}


def _numbers(folder: str) -> list[int]:
    try:
        return list(map(int, os.listdir(folder)))
    except (FileNotFoundError, ProcessLookupError):  # the process has exited
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
