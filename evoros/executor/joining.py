"""Joins what several runs ask of a worker at the same moment to one call."""

from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import CancelledError, Future
from dataclasses import dataclass, field
from functools import partial
from threading import Lock
from typing import Any

from evoros.executor.payload import KEPT, Shared
from evoros.executor.protocol import Batches, Pool

ALONE = float("inf")
"""The share of a part that is joined with no other."""


@dataclass(frozen=True, eq=False)
class Part:
    """The part of one run in a call."""

    function: Callable[..., Any]
    run: object
    share: float  # of a whole call
    shared: Shared
    asked: Any
    future: "Future[Any]" = field(default_factory=Future)


class Joining:
    """The parts that wait until a worker of a pool is free, and then become one call.

    A call has at most one part of each run, whose parts are for as many workers.
    """

    def __init__(self, pool: Pool, batches: Batches) -> None:
        self._pool, self._batches = pool, batches
        self._waiting: deque[Part] = deque()
        self._calls = 0  # under way
        self._closed = False
        self._lock = Lock()

    def add(self, part: Part) -> "Future[Any]":
        """Let a part wait; return the future of its answer.

        Raises:
            RuntimeError: it is closed.
        """
        with self._lock:
            if self._closed:
                raise RuntimeError("this pool is closed")
            self._waiting.append(part)
        self._fill()
        return part.future

    def close(self) -> None:
        """Cancel the parts that wait, before the pool cancels its calls."""
        with self._lock:
            self._closed = True
            waiting, self._waiting = self._waiting, deque()
        for part in waiting:
            part.future.cancel()
            part.future.set_running_or_notify_cancel()

    def _fill(self) -> None:
        """Give calls to the free workers."""
        while parts := self._take():
            self._send(parts)

    def _take(self) -> list[Part]:
        """Return the parts of the next call; none if no worker is free."""
        parts: list[Part] = []
        share = 0.0
        with self._lock:
            if self._calls >= max(1, self._pool.workers):
                return []
            for part in list(self._waiting):
                fits = share + part.share <= 1.0 and len(parts) < KEPT
                if parts and not (fits and all(part.run is not other.run for other in parts)):
                    continue
                self._waiting.remove(part)
                if part.future.set_running_or_notify_cancel():
                    parts.append(part)
                    share += part.share
            self._calls += bool(parts)
        return parts

    def _send(self, parts: Sequence[Part]) -> None:
        asked, shared = [part.asked for part in parts], [part.shared for part in parts]
        try:
            call = self._pool.submit(parts[0].function, self._batches, asked, *shared)
        except Exception as error:  # it does not pickle, or the pool is closed
            call = Future()
            call.set_exception(error)
        call.add_done_callback(partial(self._settle, parts))

    def _settle(self, parts: Sequence[Part], call: "Future[Any]") -> None:
        """Give each part its answer; parts of a call that failed are repeated one by one."""
        error = CancelledError() if call.cancelled() else call.exception()
        repeated = error is not None and len(parts) > 1 and not self._closed
        with self._lock:
            self._calls += len(parts) - 1 if repeated else -1
        for i, part in enumerate(parts):
            if repeated:
                self._send([part])
            elif error is not None:
                part.future.set_exception(error)
            else:
                part.future.set_result(call.result()[i])
        self._fill()
