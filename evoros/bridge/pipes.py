"""Pipes to an external process, and an exchange of lines in lockstep."""

import os
import select
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from time import monotonic

from evoros.base.errors import PilotLost, SimulationError
from evoros.bridge.process import OutsideProcess, start_process

_READ_BYTES = 4096
_LONGEST_LINE = 1 << 20  # maximum length [bytes] of a line
READ_FROM, WRITE_TO = "EVOROS_IN", "EVOROS_OUT"  # variables with descriptors; stdout stays free
ENDING_S = 1.0  # time limit [s] for a process to exit after its pipes close; ample even if busy


class Pipes:
    """Sends and receives bytes with time limits; for use by one thread."""

    def __init__(self, process: OutsideProcess, sending: int, receiving: int) -> None:
        self.process = process
        self._sending, self._receiving = sending, receiving
        os.set_blocking(sending, False)
        os.set_blocking(receiving, False)
        self._readable = select.poll()
        self._readable.register(receiving, select.POLLIN)
        # Descendants may keep a pipe open after the process has exited.
        self._readable.register(process, select.POLLIN)
        self._writable = select.poll()
        self._writable.register(sending, select.POLLOUT)
        self._writable.register(process, select.POLLIN)
        self._limit_s, self._until, self._time = 0.0, 0.0, None  # type: tuple[float, float, float | None]

    def begin(self, limit_s: float, time: float | None) -> None:
        """Start an exchange of up to ``limit_s`` [s] (wall clock) at the mission's ``time`` [s]."""
        self._limit_s, self._until, self._time = limit_s, monotonic() + limit_s, time

    def send(self, data: bytes) -> None:
        """Send bytes; raise a PilotLost if the process exited or does not read in time."""
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
        """Wait for 1 to ``size`` bytes; raise a PilotLost if the process exited or is too slow."""
        self._wait(self._readable, "did not answer within")
        try:
            data = os.read(self._receiving, size)
        except BlockingIOError:  # the process exited, but a descendant keeps the pipe open
            raise self.process.lost("ended", self._time) from None
        if not data:
            raise self.closed("output")
        return data

    def has_come(self) -> bool:
        """Return True if there is output to read; raise a PilotLost if the pipe is closed."""
        try:
            if os.read(self._receiving, 1):
                return True
        except BlockingIOError:
            return False
        raise self.closed("output")

    def closed(self, pipe: str) -> PilotLost:
        """Return the error for a process that closed a pipe, most likely by exiting."""
        self.process.running(wait_s=ENDING_S)
        return self.process.lost(f"closed its {pipe}", self._time)

    def _wait(self, poll: select.poll, silence: str) -> None:
        if not poll.poll(max(0.0, 1000.0 * (self._until - monotonic()))):
            raise self.process.lost(f"{silence} {self._limit_s:g} s", self._time)


@contextmanager
def start_pipes(
    command: Sequence[str], *, isolate: bool, environment: Mapping[str, str]
) -> Iterator[Pipes]:
    """Start a command with two pipes; see ``start_process``."""
    with ExitStack() as stack:
        reading, sending = os.pipe()
        receiving, writing = os.pipe()
        for descriptor in (sending, receiving):
            stack.callback(os.close, descriptor)
        told = {**environment, READ_FROM: str(reading), WRITE_TO: str(writing)}
        kept = reading, writing
        try:
            starting = start_process(command, isolate=isolate, environment=told, pass_fds=kept)
            process = stack.enter_context(starting)
        finally:
            os.close(reading)
            os.close(writing)
        yield Pipes(process, sending, receiving)


class LineConversation:
    """Exchanges lines with a process; for use by one thread."""

    def __init__(self, pipes: Pipes) -> None:
        self._pipes, self.process = pipes, pipes.process

    def ask(self, line: bytes, limit_s: float, time: float | None = None) -> bytes:
        """Send a line at the mission's ``time`` [s]; wait up to ``limit_s`` [s] for the answer."""
        self._pipes.begin(limit_s, time)
        if self._pipes.has_come():  # output that was not requested
            raise self._too_much(time)
        self._pipes.send(line + b"\n")
        received = b""
        while b"\n" not in received:
            received += self._pipes.receive(_READ_BYTES)
            if len(received) > _LONGEST_LINE:
                raise SimulationError(
                    f"{self.process.name} sent {_LONGEST_LINE} bytes without a newline"
                    f"{_at(time)}; it must reply to each line with one line"
                )
        answer, _, rest = received.partition(b"\n")
        if rest:
            raise self._too_much(time)
        return answer

    def _too_much(self, time: float | None) -> SimulationError:
        return SimulationError(
            f"{self.process.name} replied with more than one line{_at(time)}; it must reply to "
            f"each line with one line"
        )


def _at(time: float | None) -> str:
    return "" if time is None else f" at {time:g} s"
