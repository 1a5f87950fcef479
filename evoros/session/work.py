"""The work that commands run: a new or a resumed run or evaluation."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from typing import Protocol, TypeAlias

from evoros.executor.protocol import Executor, Pool
from evoros.session.figures import Draw
from evoros.session.status import Display
from evoros.terminal.activity import announce
from evoros.terminal.unwritable import silence_unwritable

PoolOpener: TypeAlias = Callable[[Executor], AbstractContextManager[Pool]]
"""Opens the pool in which the missions of an executor run; a sweep shares one among its jobs."""


@contextmanager
def open_pool(executor: Executor) -> Iterator[Pool]:
    """Open a pool for one work alone."""
    silence_unwritable()
    with ExitStack() as stack:
        with announce("starting workers"):  # of a cluster, that may take minutes
            pool = stack.enter_context(executor.open())
        yield pool


class Work(Protocol):
    """A run or an evaluation that is built and whose folder exists."""

    @property
    def executor(self) -> Executor:
        """Computes the missions."""
        ...

    def run(self, display: Display, draw: Draw, opener: PoolOpener = open_pool) -> object:
        """Run to the end; ``draw`` draws figures.

        Raises:
            RunStopped: a mission was lost; the work can be resumed.
        """
        ...
