"""Heartbeats of the ranks of an MPI job, by which the first one notices that another is stopped.

MPI tells when a rank has been killed, and not when it is stopped or its machine does not answer.
A call may take as long as its time limits allow, so that its time says little about its rank.
"""

import atexit
import socket
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from threading import Event, Thread

from mpi4py import MPI

from evoros.terminal.log import LOGGER

TAG = 17
"""The tag of messages to the first rank; mpi4py.futures uses other communicators."""
BEAT_S = 1.0
"""Time between two heartbeats of a rank [s]."""
WARN_S = 15.0
"""A rank that is silent that long is reported [s]."""
SILENT_S = 60.0
"""A rank that is silent that long is lost [s]; swapping or a busy file system take less."""
FIRST_S = 180.0
"""A rank that has got a call has imported evoros and begun to beat by then [s]."""


@cache
def begin() -> None:
    """Let this rank send heartbeats until it ends."""
    ending = Event()
    name = f"rank {MPI.COMM_WORLD.Get_rank()} on {socket.gethostname()}"

    def beat() -> None:
        while True:
            MPI.COMM_WORLD.send(name, dest=0, tag=TAG)
            if ending.wait(BEAT_S):
                return

    thread = Thread(target=beat, daemon=True)

    def end() -> None:  # before MPI is finalized
        ending.set()
        thread.join()

    thread.start()
    atexit.register(end)


def receive() -> list[str]:
    """Return the names of the ranks that have sent heartbeats since the last call."""
    names: list[str] = []
    while MPI.COMM_WORLD.Iprobe(source=MPI.ANY_SOURCE, tag=TAG):
        names.append(MPI.COMM_WORLD.recv(source=MPI.ANY_SOURCE, tag=TAG))
    return names


@dataclass
class Silences:
    """How long each rank has been silent [s]."""

    limit_s: float = SILENT_S
    by_rank: dict[str, float] = field(default_factory=dict)
    unheard_s: float = 0.0  # time in which more ranks had calls than have ever been heard

    def pass_time(self, seconds: float, heard: Sequence[str], running: int) -> str:
        """Add time; return which rank is lost, and after how long, or nothing.

        ``heard`` are the ranks that have sent heartbeats in it, and ``running`` the number of calls
        that ranks have taken. Do not count time in which this process did not run.
        """
        silent = {name: before + seconds for name, before in self.by_rank.items()}
        for name, now in silent.items():
            if self.by_rank[name] < WARN_S <= now and name not in heard:
                LOGGER.warning(
                    "executor=mpi: %s has been silent for %g s; the run stops if it is for %g s",
                    name,
                    WARN_S,
                    self.limit_s,
                )
        self.by_rank = silent | dict.fromkeys(heard, 0.0)
        self.unheard_s = self.unheard_s + seconds if running > len(self.by_rank) else 0.0
        for name, now in self.by_rank.items():
            if now > self.limit_s:
                return f"{name} has been silent for {self.limit_s:g} s"
        if self.unheard_s > FIRST_S:
            return f"a rank has been silent for {FIRST_S:g} s since it got its first call"
        return ""
