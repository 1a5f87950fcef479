"""A transport that sends calls through dask.distributed, and its connection to clusters."""

import asyncio
import json
import logging
import tempfile
import warnings
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Lock, Thread
from time import monotonic, sleep
from typing import Any

import dask
from distributed import Client, KilledWorker, LocalCluster, get_worker
from distributed.client import FutureCancelledError

from evoros.base.errors import RunStopped, WorkerLost, shell_line, single_line
from evoros.executor.worker_main import end_with_main_process
from evoros.plugins.clusters import node
from evoros.plugins.clusters.remote import RawAnswer
from evoros.terminal.log import LOGGER


def answer(wanted: dict[str, str], request: bytes) -> RawAnswer:
    """Run a call in a worker; see ``node.answer``."""
    return (*node.answer(wanted, request), get_worker().address)


@dataclass(eq=False)
class Sending:
    """A call sent to the given workers, or to any worker if ``nodes`` is None."""

    name: str
    wanted: dict[str, str]
    request: bytes
    nodes: list[str] | None
    waiting: asyncio.Future[Any] | None = None
    stranded: bool = False

    async def attempt(self, client: Any) -> RawAnswer:
        """Submit the call and wait for the answer."""
        where = {"workers": self.nodes, "allow_other_workers": self.nodes is not None}
        task = client.submit(answer, self.wanted, self.request, pure=False, **where)
        self.waiting = asyncio.ensure_future(client.gather(task, asynchronous=True))
        returned: RawAnswer = await self.waiting
        return returned

    def cancel(self) -> None:
        """Stop waiting."""
        if self.waiting is not None:
            self.waiting.cancel()


CONNECT_S = 10.0  # time limit [s] for the first answer of a scheduler
ANSWER_S = 60.0  # time limit [s] for later answers, longer because the scheduler may be busy
LOOK_S = 0.5  # interval [s] between requests for the list of workers
ALONE_S = 10.0  # time [s] after which calls that wait for a first worker are reported


class DaskTransport:
    """A transport that sends each call as one Dask task."""

    def __init__(self, client: Any, address: str) -> None:
        self._client, self._address = client, address
        self._loop: asyncio.AbstractEventLoop = client.loop.asyncio_loop
        # Nothing awaits Dask's coroutines after their calls are cancelled.
        self._loop.set_exception_handler(lambda _, error: LOGGER.debug("dask: %s", error))
        self._threads: dict[str, int] = {}  # number of threads per worker, by address
        self._excluded: set[str] = set()
        self._out: set[Sending] = set()  # accessed only by the thread of the event loop
        self._suspect = asyncio.Lock()  # held while a suspected call runs
        self._lock, self._closing = Lock(), Event()
        self._lost: RunStopped | None = None
        self._watcher = Thread(target=self._watch, daemon=True)

    def start(self) -> None:
        """List the workers, and start tracking them."""
        self._look()
        if self._lost is not None:
            raise self._lost
        self._watcher.start()

    @property
    def workers(self) -> int:
        """The total number of threads in suitable workers."""
        return sum(n for address, n in self._threads.items() if address not in self._excluded)

    def send(
        self, name: str, wanted: dict[str, str], request: bytes, node: str | None
    ) -> "Future[RawAnswer]":
        """Send a call; see ``Transport``."""
        if self._lost is not None:
            raise self._lost
        nodes = None if node is None else [node]
        if node is None and self._excluded:
            nodes = [other for other in self._threads if other not in self._excluded] or None
        sending = Sending(name, wanted, request, nodes)
        return asyncio.run_coroutine_threadsafe(self._deliver(sending), self._loop)

    def exclude(self, node: str, reason: str) -> None:
        """Stop sending calls to a worker; see ``Transport``."""
        with self._lock:
            if node not in self._excluded:
                self._excluded.add(node)
                LOGGER.warning("the Dask worker %s gets no missions: %s", node, reason)
        if not self.workers:
            raise RunStopped(
                f"executor: no worker of the Dask scheduler at {self._address} is suitable; "
                f"{node}: {reason}"
            )

    def stop(self, pool: str) -> None:
        """End all calls of a pool in the workers."""
        if self._lost is None:
            self.run_everywhere(node.stop, pool)

    def run_everywhere(self, function: Any, *args: Any) -> None:
        """Call a function in all workers, even busy ones; ignore workers that do not answer."""
        call = self._client.run(function, *args, on_error="ignore", asynchronous=True)
        with suppress(Exception):
            self._await(call, CONNECT_S)

    def close(self) -> None:
        """Cancel all calls and stop tracking the workers."""
        self._closing.set()
        if self._watcher.ident is not None:
            self._watcher.join()
        self._cancel_all()

    async def _deliver(self, sending: Sending) -> RawAnswer:
        self._out.add(sending)
        try:
            return await self._try_twice(sending)
        except (asyncio.CancelledError, FutureCancelledError) as error:
            if isinstance(error, FutureCancelledError) and not self._closing.is_set():
                self._lose("the connection broke")
            if self._lost is not None:
                raise self._lost from error
            raise asyncio.CancelledError from error
        except (RunStopped, WorkerLost):
            raise
        except Exception as error:  # ``answer`` raises nothing, so importing it failed
            raise RunStopped(
                f"executor: the Dask scheduler at {self._address} or one of its workers cannot run "
                f"evoros ({single_line(error)}); install the packages of this environment there, "
                "too (pip install 'evoros[dask]')"
            ) from error
        finally:
            self._out.discard(sending)

    async def _try_twice(self, sending: Sending) -> RawAnswer:
        """Try a call until it has lost too many workers, then again without other suspects."""
        # Dask attributes the loss of a worker to all calls that ran or waited on that worker.
        with suppress(KilledWorker):
            return await self._persist(sending)
        async with self._suspect:
            try:
                return await self._persist(sending)
            except KilledWorker as error:
                times = error.allowed_failures + 1  # a lower bound, because Dask misses some losses
                raise WorkerLost(
                    f"{sending.name}: lost, because at least {2 * times} Dask workers exited "
                    f"while running the call, {times} of them in a second attempt; read the "
                    f"output of the worker {error.last_worker.address}, and give the workers "
                    "more memory if memory ran out"
                ) from error

    async def _persist(self, sending: Sending) -> RawAnswer:
        """Submit a call; resubmit it if all its workers have left."""
        while True:
            if self._lost is not None:
                raise self._lost
            try:
                return await sending.attempt(self._client)
            except asyncio.CancelledError:
                if not sending.stranded:
                    raise
                sending.stranded, sending.nodes = False, None

    def _watch(self) -> None:
        """Track the workers, and report when calls wait because there are none."""
        alone_s = 0.0
        while self._lost is None and not self._closing.wait(LOOK_S):
            self._look()
            before, alone_s = alone_s, alone_s + LOOK_S if self._out and not self.workers else 0.0
            if before < ALONE_S <= alone_s:
                LOGGER.warning(
                    "executor: no worker for missions has joined the Dask scheduler at "
                    "%(address)s; waiting for one (start it with: dask worker %(address)s)",
                    {"address": self._address},
                )

    def _look(self) -> None:
        try:
            threads = self._await(self._client.nthreads(asynchronous=True), ANSWER_S)
        except Exception as error:
            if not self._closing.is_set():
                self._lose(single_line(error) or type(error).__name__)
            return
        self._threads = dict(threads)
        self._in_loop(self._free_stranded)

    def _free_stranded(self) -> None:
        """Resubmit calls whose workers have left; the scheduler might wait for them forever."""
        for sending in self._out:
            if sending.nodes and self._threads.keys().isdisjoint(sending.nodes):
                sending.stranded = True
                sending.cancel()

    def _await(self, coroutine: Coroutine[Any, Any, Any], limit_s: float) -> Any:
        async def limited() -> Any:
            return await asyncio.wait_for(coroutine, limit_s)

        return asyncio.run_coroutine_threadsafe(limited(), self._loop).result(limit_s + CONNECT_S)

    def _lose(self, reason: str) -> None:
        with self._lock:
            if self._lost is not None:
                return
            self._lost = RunStopped(
                f"executor: the Dask scheduler at {self._address} exited or can no longer be "
                f"reached ({reason}); restart the scheduler and its workers, or choose another "
                f"executor"
            )
        self._cancel_all()

    def _cancel_all(self) -> None:
        def cancel() -> None:
            for sending in self._out:
                sending.cancel()

        self._in_loop(cancel)

    def _in_loop(self, function: Callable[[], None]) -> None:
        with suppress(RuntimeError):  # the loop is closed, so no call is waiting
            self._loop.call_soon_threadsafe(function)


LOCAL_SETTINGS = {
    "distributed.scheduler.worker-ttl": "60s",  # replaces a stopped worker
    "distributed.worker.memory.terminate": False,  # calls run in separate processes
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.target": False,
}


@contextmanager
def silence() -> Iterator[None]:
    """Keep Dask's messages off the terminal; evoros reports each error in one line."""
    names = [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]
    levels = {logging.getLogger(name): logging.getLogger(name).level for name in names}
    for logger in levels:
        logger.setLevel(logging.CRITICAL + 1)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="distributed")
        try:
            yield
        finally:
            for logger, level in levels.items():
                logger.setLevel(level)


@contextmanager
def start_cluster(workers: int) -> Iterator[str]:
    """Start a cluster of worker processes on this machine; yield the address of its scheduler."""
    with (
        tempfile.TemporaryDirectory(prefix="evoros-dask-") as folder,
        dask.config.set(LOCAL_SETTINGS),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address=None,
            worker_dashboard_address=None,
            memory_limit=0,
            local_directory=folder,
            silence_logs=logging.CRITICAL,
        ) as cluster,
        connect(cluster.scheduler_address) as transport,
    ):
        transport.run_everywhere(end_with_main_process)
        yield cluster.scheduler_address


def _read_address(address: str) -> str:
    if "://" in address:
        return address
    end = monotonic() + CONNECT_S
    while True:
        try:
            return str(json.loads(Path(address).expanduser().read_bytes())["address"])
        except (OSError, ValueError, KeyError, TypeError) as error:  # missing or incomplete
            if monotonic() > end:
                raise RunStopped(
                    f"executor.address: {address} is not a scheduler file "
                    f"({single_line(error)}); start a scheduler: "
                    f"{shell_line('dask', 'scheduler', '--scheduler-file', address)}"
                ) from error
            sleep(0.1)


@contextmanager
def connect(address: str) -> Iterator[DaskTransport]:
    """Connect to a scheduler; raise RunStopped if it does not answer."""
    address = _read_address(address)
    try:
        client: Any = Client(address, timeout=CONNECT_S, set_as_default=False, name="evoros")
    except (OSError, TimeoutError, ValueError, ImportError) as error:
        raise RunStopped(
            f"executor.address: no Dask scheduler answers at {address} ({single_line(error)}); "
            f"start one there (dask scheduler), or set executor.address to a running scheduler"
        ) from error
    transport = DaskTransport(client, address)
    try:
        transport.start()
        yield transport
    finally:
        transport.close()
        with suppress(Exception):  # the scheduler may have ended
            client.close(timeout=5)
