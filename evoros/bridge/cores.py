"""Keeps the two sides of a lock-step on one core.

Only one side works at a time. On two cores every hand-over wakes a core that has gone idle, which
takes longer than the work of a frame, above all on virtual machines.
"""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

CLAIM = "\0evoros core {}"
"""An abstract address of Linux, without a file; the system gives it up with the socket."""
PROCESSOR = 36
"""Place of the core in /proc/.../stat, behind the name in parentheses."""


@contextmanager
def share_core(*, wanted: bool = True) -> Iterator[None]:
    """Keep this thread, and the processes that it starts, on a core that no other mission keeps.

    If it is not wanted, or every core is taken, or the system does not allow it, nothing changes.
    """
    allowed = os.sched_getaffinity(0) if wanted and hasattr(os, "sched_getaffinity") else set()
    claim = _claim_core(allowed)
    if claim is None:
        yield
        return
    core, holding = claim
    with holding:
        with suppress(OSError):
            os.sched_setaffinity(0, {core})
        try:
            yield
        finally:
            with suppress(OSError):  # a core may have gone offline
                os.sched_setaffinity(0, allowed)


def _claim_core(allowed: set[int]) -> tuple[int, socket.socket] | None:
    """Claim one of several cores, best the present one: the system spreads busy processes."""
    present = _find_core() if len(allowed) > 1 else None
    if present is None:
        return None
    for core in sorted(allowed, key=lambda core: (core < present, core)):
        claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            claim.bind(CLAIM.format(core))
        except OSError:  # another mission has it
            claim.close()
            continue
        return core, claim
    return None


def _find_core() -> int | None:
    """Return the core on which this thread runs; None if the system does not tell."""
    try:
        status = Path("/proc/thread-self/stat").read_text(encoding="utf-8")
        return int(status.rpartition(")")[2].split()[PROCESSOR])
    except (OSError, ValueError, IndexError):
        return None
