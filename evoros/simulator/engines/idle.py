"""Caches the idle engines of a process for later simulations."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Generic, Protocol, TypeVar


class _Engine(Protocol):
    def close(self) -> None: ...
    def forget(self) -> None: ...


E = TypeVar("E", bound=_Engine)


class IdleEngines(Generic[E]):
    """Engines that wait for the next mission; forked processes do not inherit them."""

    def __init__(self) -> None:
        self._idle: list[E] = []
        self._process = os.getpid()

    def _list(self) -> list[E]:
        if self._process != os.getpid():
            self._idle, self._process = [], os.getpid()
        return self._idle

    @contextmanager
    def take(self, make: Callable[[], E]) -> Iterator[E]:
        """Yield an idle or new engine; close the engine if the simulation fails."""
        idle = self._list()
        engine = idle.pop() if idle else make()
        try:
            yield engine
        except BaseException:
            engine.close()
            raise
        idle.append(engine)

    def forget(self) -> None:
        """Discard the models of all idle engines, as for a new design."""
        for engine in self._list():
            engine.forget()

    def close(self) -> None:
        """Close all engines; the next mission creates a new one."""
        while self._list():
            self._list().pop().close()
