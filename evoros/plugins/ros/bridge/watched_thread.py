"""Detects whether a thread is waiting; needs only Linux and the standard library."""

from __future__ import annotations

import os
import re
import struct
import threading
import time

# asm/unistd.h: clock_nanosleep, nanosleep. Threads at rest may also sleep, as in rospy.spin(), so
# the duration of a sleep must be known; it is found only in the thread's memory.
_SLEEPING = {"x86_64": "230 35", "aarch64": "115 101"}
CLOCK_SLEEP, SLEEP = _SLEEPING.get(os.uname().machine, "none none").encode().split()
UNTIL = 1  # linux/time.h: TIMER_ABSTIME
NOWHERE = b"0"  # value of wchan for a thread that does not wait
ASLEEP, ENDED = b"S", (b"Z", b"X")  # states in stat
UNTOLD = b"0 0 0\n"  # content of schedstat on a kernel without statistics
PLACE_BYTES = 64
"""Maximum length of a kernel function's name."""
SHORT_S = 0.001
"""Duration of a sleep [s] below which a thread counts as working.

rospy's publishers call time.sleep(0), which lasts up to the kernel's timer slack of 50 us.
"""
TRIAL_LOOKS, TRIAL_PAUSE_S = 20, 0.0002
"""Maximum number of checks of a thread that will soon wait, and pause between checks [s]."""


class WatchedThread:
    """A thread's open files in /proc, and their contents when last read."""

    def __init__(self, pid: int, tid: int) -> None:
        """Open the files.

        Raises:
            FileNotFoundError, ProcessLookupError: the thread has exited.
        """
        self.pid, self.tid = pid, tid
        self._files: list[int] = []
        try:
            for name in ("wchan", "syscall", "stat", "schedstat"):
                self._files.append(os.open(f"/proc/{pid}/task/{tid}/{name}", os.O_RDONLY))
        except OSError:
            self.close()
            raise
        self._place, self._call, self._state, self._runs = self._files
        self._known_place = b""  # kernel function in which the thread was waiting
        # Content of schedstat during a sleep, and end of the sleep by time.monotonic().
        self._sleep: tuple[bytes, float] = (UNTOLD, 0.0)

    @property
    def numbers(self) -> tuple[int, int]:
        """The ids of the process and the thread."""
        return self.pid, self.tid

    def close(self) -> None:
        """Close the files."""
        for file in self._files:
            os.close(file)

    def waits(self, tells_places: bool) -> bool:
        """Return True if the thread is waiting for an external event or has exited.

        Without ``tells_places``, the system call is read before the state; see ``rest``.

        Raises:
            PermissionError: the process cannot be observed; the error contains the file's name.
        """
        place = os.pread(self._place, PLACE_BYTES, 0) if tells_places else b""
        if place and place == self._known_place:
            return True
        runs = os.pread(self._runs, 128, 0)
        if place not in (b"", NOWHERE) and runs == self._sleep[0]:
            return self._sleep[1] - time.monotonic() > SHORT_S  # it has not run since then
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
        """Return the number and arguments of the thread's system call; ``running`` if it runs."""
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
    """Return True if the kernel names where threads wait, and stops when they are woken.

    This needs Linux 5.16 or later, built with the names of kernel functions.
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
            time.sleep(TRIAL_PAUSE_S)
            told = told or os.pread(file.fileno(), PLACE_BYTES, 0) not in (b"", NOWHERE)
    done.set()
    thread.join()
    return told
