"""The client of the server of Gazebo's physics, a process of its own."""

import struct
from contextlib import ExitStack
from enum import IntEnum
from pathlib import Path

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError, SimulationError, single_line
from evoros.bridge.pipes import start_pipes
from evoros.simulator.engines.gazebo_library import INSTALL

_REQUEST = struct.Struct("=iiiiq")  # operation, number, steps, feeling, size
_ANSWER = struct.Struct("=qq")  # 1 for an error, size
_READ_BYTES = 1 << 16


class Operation(IntEnum):
    """What the server can do; tests use the last one."""

    START, OPEN, RESET, ADVANCE, FORGET, PROBE = range(6)


class GazeboServer:
    """Sends requests and waits for the answers. Only one thread uses it.

    The process has a folder of its own as its home and ends with this one, whatever ends that.
    Libraries may print to its standard output.
    """

    def __init__(self, program: Path, limit_s: float) -> None:
        """Start the program, each of whose answers may take a wall-clock time [s].

        Raises:
            InputError: the library cannot be used.
            PilotLost: the program ended, or did not answer in time.
        """
        self.limit_s = limit_s
        with ExitStack() as stack:
            starting = start_pipes([str(program)], isolate=False, environment={})
            self._pipes = stack.enter_context(starting)
            try:
                self.ask(Operation.START, 0)
            except SimulationError as error:
                raise InputError(f"simulator=gazebo: {error}; {INSTALL}") from error
            self._stack = stack.pop_all()

    def close(self) -> None:
        """End the process."""
        self._stack.close()

    def ask(
        self,
        operation: Operation,
        number: int,
        body: bytes = b"",
        steps: int = 0,
        feeling: bool = False,
        time: float | None = None,
    ) -> Array:
        """Send a request about the simulation of a ``number`` and return the answer's values.

        Raises:
            SimulationError: the library refuses the request.
            PilotLost: the process ended, or did not answer in time; ``time`` is the mission's [s].
        """
        self._pipes.begin(self.limit_s, time)
        self._pipes.send(_REQUEST.pack(operation, number, steps, feeling, len(body)) + body)
        data = self._pipes.receive(_READ_BYTES)
        while len(data) < _ANSWER.size:
            data += self._pipes.receive(_READ_BYTES)
        failed, size = _ANSWER.unpack_from(data)
        parts, missing = [data], _ANSWER.size + size - len(data)
        while missing > 0:
            parts.append(self._pipes.receive(_READ_BYTES))
            missing -= len(parts[-1])
        answer = b"".join(parts)
        if failed:
            reason = answer[_ANSWER.size :].decode(errors="replace")
            raise SimulationError(f"Gazebo: {single_line(reason)}")
        return np.frombuffer(answer, offset=_ANSWER.size)
