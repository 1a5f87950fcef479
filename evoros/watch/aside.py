"""A program beside runs: in a session of its own, because runs must go first."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

LOWEST = 19
"""The niceness of the program and of its session."""
AUTOGROUP = Path("/proc/self/autogroup")
"""Linux shares processors among sessions first; niceness counts within one (``man 7 sched``)."""


def run_aside(command: Sequence[str]) -> int:
    """Run a program that calls `give_way`, pass Ctrl-C on to it, and return its exit status."""
    with subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True) as process:
        for signum in (signal.SIGINT, signal.SIGTERM):
            signal.signal(signum, lambda received, _: process.send_signal(received))
        status = process.wait()
    return status if status >= 0 else 128 - status


def give_way() -> None:
    """Let all others go first, and end this program when the one that started it ends."""
    os.nice(LOWEST)
    with suppress(OSError):  # no Linux, or a kernel without it
        AUTOGROUP.write_text(str(LOWEST))
    threading.Thread(target=_end_after_starter, daemon=True).start()


def _end_after_starter() -> None:
    os.read(sys.stdin.fileno(), 1)  # a buffer would stay locked at the end of this program
    os.kill(os.getpid(), signal.SIGTERM)
