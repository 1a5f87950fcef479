"""Connections to Dask clusters, and local clusters."""

import json
import logging
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import dask
from distributed import Client, LocalCluster

from evoros.base.errors import RunStopped, shell_line, single_line
from evoros.executor.worker_main import end_with_main_process
from evoros.plugins.clusters.dask_transport import CONNECT_S, DaskTransport

LOCAL_SETTINGS = {
    "distributed.scheduler.worker-ttl": "60s",  # so that a stopped worker is replaced
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
    """Start a cluster of worker processes on this machine; yield the scheduler's address."""
    with (
        tempfile.TemporaryDirectory(prefix="evoros-dask-") as folder,
        dask.config.set(LOCAL_SETTINGS),
        LocalCluster(  # type: ignore[no-untyped-call]
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
    """Return the address, or wait for a scheduler file and return the address in it."""
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
    """Connect to a scheduler; raise a RunStopped if none answers."""
    address = _read_address(address)
    try:
        client: Any = Client(  # type: ignore[no-untyped-call]
            address, timeout=CONNECT_S, set_as_default=False, name="evoros"
        )
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
        with suppress(Exception):  # the scheduler may be gone
            client.close(timeout=5)
