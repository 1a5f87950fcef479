"""Two pipes to a process outside, which is told their descriptors by variables."""

import os
import select
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from time import monotonic

from evoros.base.errors import PilotLost
from evoros.bridge.process import OutsideProcess, start_process

READ_FROM, WRITE_TO = "EVOROS_IN", "EVOROS_OUT"
"""The variables that tell a program its descriptors, so that its standard output is free."""
ENDING_S = 1.0
"""Between the end of a process's pipes and the end of the process [s], on a busy machine."""


class Pipes:
    """Sends and receives bytes within limits of time. Only one thread uses it."""

    def __init__(self, process: OutsideProcess, sending: int, receiving: int) -> None:
        self.process = process
        self._sending, self._receiving = sending, receiving
        os.set_blocking(sending, False)
        os.set_blocking(receiving, False)
        self._readable = select.poll()
        self._readable.register(receiving, select.POLLIN)
        # Descendants may keep a pipe open that the process itself has left.
        self._readable.register(process, select.POLLIN)
        self._writable = select.poll()
        self._writable.register(sending, select.POLLOUT)
        self._writable.register(process, select.POLLIN)
        self._limit_s, self._until, self._time = 0.0, 0.0, None  # type: tuple[float, float, float | None]

    def begin(self, limit_s: float, time: float | None) -> None:
        """Begin an exchange that may take a wall-clock time [s], at a mission's ``time`` [s]."""
        self._limit_s, self._until, self._time = limit_s, monotonic() + limit_s, time

    def send(self, data: bytes) -> None:
        """Send bytes.

        Raises:
            PilotLost: the process ended, or did not read in time.
        """
        while data:
            try:
                data = data[os.write(self._sending, data) :]
            except BrokenPipeError:
                raise self.closed("input") from None
            except BlockingIOError:
                self._wait(self._writable, "did not read for")
                if not self.process.running():
                    raise self.process.lost("ended", self._time) from None

    def receive(self, size: int) -> bytes:
        """Wait for bytes, from 1 to ``size``.

        Raises:
            PilotLost: the process ended, or did not answer in time.
        """
        self._wait(self._readable, "did not answer within")
        try:
            data = os.read(self._receiving, size)
        except BlockingIOError:  # the process has ended, and others hold the pipe
            raise self.process.lost("ended", self._time) from None
        if not data:
            raise self.closed("output")
        return data

    def has_come(self) -> bool:
        """Whether there is something to read now.

        Raises:
            PilotLost: the process has closed its output.
        """
        try:
            if os.read(self._receiving, 1):
                return True
        except BlockingIOError:
            return False
        raise self.closed("output")

    def closed(self, pipe: str) -> PilotLost:
        """Create the error for a process that closed a pipe, most likely because it ended."""
        self.process.running(wait_s=ENDING_S)
        return self.process.lost(f"closed its {pipe}", self._time)

    def _wait(self, poll: select.poll, silence: str) -> None:
        if not poll.poll(max(0.0, 1000.0 * (self._until - monotonic()))):
            raise self.process.lost(f"{silence} {self._limit_s:g} s", self._time)


@contextmanager
def start_pipes(
    command: Sequence[str], *, isolate: bool, environment: Mapping[str, str]
) -> Iterator[Pipes]:
    """Start a command with two pipes; leaving the context kills it with all that it started.

    Raises:
        LaunchError: see ``start_process``.
    """
    with ExitStack() as stack:
        reading, sending = os.pipe()
        receiving, writing = os.pipe()
        for descriptor in (sending, receiving):
            stack.callback(os.close, descriptor)
        names = {READ_FROM: str(reading), WRITE_TO: str(writing)}
        try:
            starting = start_process(
                command,
                isolate=isolate,
                environment={**environment, **names},
                pass_fds=(reading, writing),
            )
            process = stack.enter_context(starting)
        finally:
            os.close(reading)
            os.close(writing)
        yield Pipes(process, sending, receiving)
