"""What the commands can run: a new or a resumed run or evaluation."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol, TypeAlias

from evoros.executor.protocol import Executor, Pool
from evoros.session.status import Display

PoolOpener: TypeAlias = Callable[[Executor], AbstractContextManager[Pool]]
"""Opens the pool in which the missions of an executor run; a sweep shares one among its jobs."""


def open_pool(executor: Executor) -> AbstractContextManager[Pool]:
    """Open a pool for one work alone."""
    return executor.open()


class Work(Protocol):
    """A run or an evaluation that is built and whose folder exists."""

    @property
    def executor(self) -> Executor:
        """Computes the missions."""
        ...

    def run(self, display: Display, opener: PoolOpener = open_pool) -> object:
        """Run to the end.

        Raises:
            RunStopped: a mission was lost; the work can be resumed.
        """
        ...
