"""A conversation with a process outside: a line each way, in lock-step."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from evoros.base.errors import SimulationError
from evoros.bridge.pipes import Pipes, start_pipes

READ_BYTES = 4096
LONGEST_LINE = 1 << 20
"""Bytes; a program that writes more without an end of line does not speak in lines."""


class LineConversation:
    """Sends a line, waits for one. Only one thread uses it."""

    def __init__(self, pipes: Pipes) -> None:
        self._pipes, self.process = pipes, pipes.process

    def ask(self, line: bytes, limit_s: float, time: float | None = None) -> bytes:
        """Send a line and return the answer, each without its end; ``time`` is the mission's [s].

        Raises:
            PilotLost: the process ended, or did not answer within the wall-clock time.
            SimulationError: it answered more than one line, or one without end.
        """
        self._pipes.begin(limit_s, time)
        if self._pipes.has_come():  # since the last answer
            raise self._too_much(time)
        self._pipes.send(line + b"\n")
        received = b""
        while b"\n" not in received:
            received += self._pipes.receive(READ_BYTES)
            if len(received) > LONGEST_LINE:
                raise SimulationError(
                    f"{self.process.name} answered {LONGEST_LINE} bytes without an end of line"
                    f"{_at(time)}; it must answer each line with one"
                )
        answer, _, rest = received.partition(b"\n")
        if rest:
            raise self._too_much(time)
        return answer

    def _too_much(self, time: float | None) -> SimulationError:
        return SimulationError(
            f"{self.process.name} answered more than one line{_at(time)}; it must answer each "
            f"line with one"
        )


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
    with start_pipes(command, isolate=isolate, environment=environment) as pipes:
        yield LineConversation(pipes)
