"""Connects to a dask cluster, or starts one on this machine."""

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

from evoros.base.errors import RunStopped, single_line
from evoros.executor.dask_transport import CONNECT_S, DaskTransport
from evoros.executor.worker_main import end_with_main_process

LOCAL_SETTINGS = {
    "distributed.scheduler.worker-ttl": "60s",  # a worker that is stopped is replaced
    "distributed.worker.memory.terminate": False,  # its calls run in processes of their own
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.target": False,
}
POLL_S = 0.1
"""Between two looks for a scheduler file [s]."""
LOOPBACK = "127.0.0.1"


@contextmanager
def silence() -> Iterator[None]:
    """Keep dask's messages off the terminal; evoros reports their meaning in one line."""
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
    """Start a cluster of worker processes on this machine; yields its scheduler's address."""
    with (
        tempfile.TemporaryDirectory(prefix="evoros-dask-") as folder,
        dask.config.set(LOCAL_SETTINGS),
        LocalCluster(  # type: ignore[no-untyped-call]
            n_workers=workers,
            threads_per_worker=1,
            host=LOOPBACK,
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
    """Return the address, or the address in the scheduler file at that path.

    Raises:
        RunStopped: the file cannot be read, also after a while.
    """
    if "://" in address:
        return address
    end = monotonic() + CONNECT_S
    while True:
        try:
            return str(json.loads(Path(address).expanduser().read_bytes())["address"])
        except (OSError, ValueError, KeyError, TypeError) as error:  # none yet, or a part of it
            if monotonic() > end:
                raise RunStopped(
                    f"executor.address: {address} must be a file that a scheduler has written "
                    f"({single_line(error)}); start one (dask scheduler --scheduler-file {address})"
                ) from error
            sleep(POLL_S)


@contextmanager
def connect(address: str) -> Iterator[DaskTransport]:
    """Connect to a scheduler.

    Raises:
        RunStopped: nobody answers.
    """
    address = _read_address(address)
    try:
        client: Any = Client(  # type: ignore[no-untyped-call]
            address, timeout=CONNECT_S, set_as_default=False, name="evoros"
        )
    except (OSError, TimeoutError, ValueError, ImportError) as error:
        raise RunStopped(
            f"executor.address: no dask scheduler answers at {address} ({single_line(error)}); "
            f"start one there (dask scheduler) or correct the address"
        ) from error
    transport = DaskTransport(client, address)
    try:
        transport.start()
        yield transport
    finally:
        transport.close()
        with suppress(Exception):  # the scheduler may be gone
            client.close(timeout=5)
