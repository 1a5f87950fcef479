"""A conversation with a process outside: a line each way, in lock-step."""

import os
import select
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from time import monotonic

from evoros.base.errors import PilotLost, SimulationError
from evoros.bridge.process import OutsideProcess, start_process

READ_FROM, WRITE_TO = "EVOROS_IN", "EVOROS_OUT"
"""The variables that tell a program its descriptors, so that its standard output is free."""
ENDING_S = 1.0
"""Between the end of a process's pipes and the end of the process [s], on a busy machine."""
READ_BYTES = 4096
LONGEST_LINE = 1 << 20
"""Bytes; a program that writes more without an end of line does not speak in lines."""


class LineConversation:
    """Sends a line, waits for one. Only one thread uses it."""

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
        self._buffer = b""

    def ask(self, line: bytes, limit_s: float, time: float | None = None) -> bytes:
        """Send a line and return the answer, each without its end; ``time`` is the mission's [s].

        Raises:
            PilotLost: the process ended, or did not answer within the wall-clock time.
            SimulationError: it answered more than one line, or one without end.
        """
        until = monotonic() + limit_s
        with suppress(BlockingIOError):  # nothing has come since the last answer
            if os.read(self._receiving, 1):
                raise self._too_much(time)
            raise self._closed("output", time)
        self._send(line + b"\n", until, limit_s, time)
        while b"\n" not in self._buffer:
            self._read(until, limit_s, time)
        answer, _, rest = self._buffer.partition(b"\n")
        if rest:
            raise self._too_much(time)
        self._buffer = b""
        return answer

    def _too_much(self, time: float | None) -> SimulationError:
        return SimulationError(
            f"{self.process.name} answered more than one line{_at(time)}; it must answer each "
            f"line with one"
        )

    def _closed(self, pipe: str, time: float | None) -> PilotLost:
        """Create the error for a process that closed a pipe, most likely because it ended."""
        self.process.running(wait_s=ENDING_S)
        return self.process.lost(f"closed its {pipe}", time)

    def _send(self, data: bytes, until: float, limit_s: float, time: float | None) -> None:
        while data:
            try:
                data = data[os.write(self._sending, data) :]
            except BrokenPipeError:
                raise self._closed("input", time) from None
            except BlockingIOError:
                self._wait(self._writable, until, f"did not read for {limit_s:g} s", time)
                if not self.process.running():
                    raise self.process.lost("ended", time) from None

    def _read(self, until: float, limit_s: float, time: float | None) -> None:
        self._wait(self._readable, until, f"did not answer within {limit_s:g} s", time)
        try:
            data = os.read(self._receiving, READ_BYTES)
        except BlockingIOError:  # the process has ended, and others hold the pipe
            raise self.process.lost("ended", time) from None
        if not data:
            raise self._closed("output", time)
        self._buffer += data
        if len(self._buffer) > LONGEST_LINE:
            raise SimulationError(
                f"{self.process.name} answered {LONGEST_LINE} bytes without an end of line"
                f"{_at(time)}; it must answer each line with one"
            )

    def _wait(self, poll: select.poll, until: float, silence: str, time: float | None) -> None:
        if not poll.poll(max(0.0, 1000.0 * (until - monotonic()))):
            raise self.process.lost(silence, time)


def _at(time: float | None) -> str:
    return "" if time is None else f" at {time:g} s"


@contextmanager
def start_conversation(
    command: Sequence[str], *, isolate: bool, environment: Mapping[str, str]
) -> Iterator[LineConversation]:
    """Start a command that speaks lines; leaving the context kills it with all that it started.

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
        yield LineConversation(process, sending, receiving)
