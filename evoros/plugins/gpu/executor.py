"""An executor that runs missions in batches, one per thread of a GPU."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Future
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from functools import partial
from threading import Lock
from typing import TYPE_CHECKING, Annotated, Any

from evoros.base.checks import COUNT, checked, one_of
from evoros.base.errors import RunStopped
from evoros.executor.processes import Processes
from evoros.executor.protocol import KEPT, Batches, Pool, Shared
from evoros.terminal.log import LOGGER

if TYPE_CHECKING:
    from evoros.compilation.device import Device


@dataclass(frozen=True, eq=False)
class Part:
    """The missions that one run adds to a call."""

    function: Callable[..., Any]
    run: object
    share: float  # fraction of a full call
    shared: Shared
    asked: Any
    future: "Future[Any]" = field(default_factory=Future)


class Joining:
    """A queue of parts, joined into one call as soon as a worker is free."""

    def __init__(self, pool: Pool, batches: Batches) -> None:
        self._pool, self._batches = pool, batches
        self._waiting: deque[Part] = deque()
        self._calls = 0  # number of running calls
        self._closed = False
        self._lock = Lock()

    def add(self, part: Part) -> "Future[Any]":
        """Queue a part; return the future of its answer."""
        with self._lock:
            if self._closed:
                raise RuntimeError("this pool is closed")
            self._waiting.append(part)
        self._fill()
        return part.future

    def close(self) -> None:
        """Cancel the waiting parts, before the pool cancels its calls."""
        with self._lock:
            self._closed = True
            waiting, self._waiting = self._waiting, deque()
        for part in waiting:
            part.future.cancel()
            part.future.set_running_or_notify_cancel()

    def _fill(self) -> None:
        while parts := self._take():
            self._send(parts)

    def _take(self) -> list[Part]:
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
        except Exception as error:  # the call cannot be pickled, or the pool is closed
            call = Future()
            call.set_exception(error)
        call.add_done_callback(partial(self._settle, parts))

    def _settle(self, parts: Sequence[Part], call: "Future[Any]") -> None:
        """Give each part its answer; after a failed call, repeat the parts one by one."""
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


GPU, CPU = "gpu", "cpu"  # devices: an NVIDIA GPU, or the CPU running the same kernel in tests
ON_CPU, STOP = "cpu", "stop"  # if no GPU is usable: run missions on the CPU, or stop the run


@dataclass(frozen=True)
class GpuBatches:
    """Settings for batches of missions on a device."""

    device: str
    missions: int  # maximum number of missions per launch
    fallback: str
    option: str = "executor=gpu"

    def open_device(self) -> "Device":
        """Open the device in a worker process."""
        from evoros.compilation.device import Host  # slow: imports LLVM
        from evoros.plugins.gpu.cuda import Cuda, import_driver

        return Cuda(import_driver()) if self.device == GPU else Host()

    def give_up(self, reason: str) -> str:
        """Return the message that missions run on the CPU; stop the run if ``fallback`` is STOP."""
        lack = f"executor.device=gpu: {reason}"
        if self.fallback == STOP:
            fix = (
                "resume when a GPU is available, or with executor.fallback=cpu or "
                "executor=processes"
            )
            raise RunStopped(f"{lack}; {fix}")
        return f"{lack}; missions run on the CPU, as with executor=processes"


@dataclass(frozen=True, kw_only=True)
@checked
class Gpu(Processes):
    """An executor that runs missions in one kernel launch if all their parts can be compiled.

    A free worker launches the waiting missions of all runs; other calls run as with ``Processes``.
    """

    device: Annotated[str, one_of(GPU, CPU)] = GPU
    missions: Annotated[int, COUNT] = 1024  # maximum number of missions per launch
    fallback: Annotated[str, one_of(ON_CPU, STOP)] = ON_CPU

    @contextmanager
    def open(self) -> Iterator[Pool]:
        """Start the workers."""
        batches = GpuBatches(self.device, self.missions, self.fallback)
        if self.device == GPU and (lack := _find_lack()):
            LOGGER.warning("%s", batches.give_up(lack))
            with super().open() as pool:
                yield pool
            return
        with super().open() as pool, closing(Joining(pool, batches)) as joining:
            yield _Batching(pool, batches, joining)


def _find_lack() -> str:
    from evoros.compilation.device import DeviceError
    from evoros.plugins.gpu.cuda import import_driver, require_gpu  # slow: imports LLVM

    try:
        require_gpu(import_driver())
    except DeviceError as error:
        return str(error)
    return ""


@dataclass(frozen=True)
class _Batching:
    pool: Pool
    batches: Batches
    joining: Joining

    @property
    def workers(self) -> int:
        return self.pool.workers

    @property
    def shares_files(self) -> bool:
        return self.pool.shares_files

    def submit(self, function: Callable[..., Any], /, *args: Any) -> "Future[Any]":
        return self.pool.submit(function, *args)

    def join(
        self, function: Callable[..., Any], run: object, share: float, shared: Shared, asked: Any
    ) -> "Future[Any]":
        return self.joining.add(Part(function, run, share, shared, asked))
