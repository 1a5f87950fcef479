"""Runs missions together, as threads of a GPU."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import closing, contextmanager
from dataclasses import dataclass
from typing import Annotated, Any

from evoros.base.checks import COUNT, checked, one_of
from evoros.base.errors import RunStopped
from evoros.executor.joining import Joining, Part
from evoros.executor.payload import Shared
from evoros.executor.processes import Processes
from evoros.executor.protocol import Batches, Pool
from evoros.terminal.log import LOGGER

GPU, CPU = "gpu", "cpu"
"""Devices: NVIDIA's GPUs; the cores of this machine, which run the same kernel for tests of it."""
ON_CPU, STOP = "cpu", "stop"
"""What happens if the GPU cannot be used: missions run on the CPU, or the run stops."""


@dataclass(frozen=True, kw_only=True)
@checked
class Gpu(Processes):
    """Runs missions together in a launch of a kernel, where their parts can be compiled for it.

    Missions of all runs that wait as a worker becomes free are one launch.

    Worker processes open missions, launch them, and compute their outcomes. All other calls, and
    missions with other parts, run as under ``Processes``.
    """

    device: Annotated[str, one_of(GPU, CPU)] = GPU
    missions: Annotated[int, COUNT] = 1024  # at most, in a launch
    fallback: Annotated[str, one_of(ON_CPU, STOP)] = ON_CPU

    @contextmanager
    def open(self) -> Iterator[Pool]:
        """Start the workers.

        Raises:
            InputError: cuda-bindings is not installed.
            RunStopped: there is no GPU, and the run shall stop then.
        """
        if self.device == GPU and (lack := _find_lack()):
            if self.fallback == STOP:
                raise RunStopped(explain_stop(lack))
            LOGGER.warning("%s", explain_fallback(lack))
            with super().open() as pool:
                yield pool
            return
        with super().open() as pool:
            batches = Batches(self.device, self.missions, self.fallback)
            with closing(Joining(pool, batches)) as joining:
                yield _Batching(pool, batches, joining)


def explain_stop(reason: str) -> str:
    """Return the line of a run that stops because its GPU cannot be used."""
    return (
        f"executor.device=gpu: {reason}; resume once there is a GPU that can be used, or with "
        f"executor.fallback=cpu or executor=processes"
    )


def explain_fallback(reason: str) -> str:
    """Return the line of a run that goes on without its GPU."""
    return f"executor.device=gpu: {reason}; missions run on the CPU, as with executor=processes"


def _find_lack() -> str:
    """Return why no GPU can be used; empty if one can."""
    from evoros.compilation.cuda import import_driver, require_gpu  # LLVM takes long to import
    from evoros.compilation.device import DeviceError

    try:
        require_gpu(import_driver())
    except DeviceError as error:
        return str(error)
    return ""


@dataclass(frozen=True)
class _Batching:
    """A pool whose workers run missions together."""

    pool: Pool
    batches: Batches
    joining: Joining

    @property
    def workers(self) -> int:
        """The number of workers."""
        return self.pool.workers

    @property
    def shares_files(self) -> bool:
        """Whether the workers share the files of this process."""
        return self.pool.shares_files

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        """Call ``function(*args)`` in a worker."""
        return self.pool.submit(function, *args)

    def join(
        self, function: Callable[..., Any], run: object, share: float, shared: Shared, asked: Any
    ) -> "Future[Any]":
        """Add a part to the next call of a worker."""
        return self.joining.add(Part(function, run, share, shared, asked))
