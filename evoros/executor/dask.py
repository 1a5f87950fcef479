"""Runs calls in the workers of a dask cluster, which may come and go."""

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import Rule, checked
from evoros.base.errors import InputError
from evoros.base.extras import require_extra
from evoros.executor.attempts import Limits, null_or_whole
from evoros.executor.processes import available_cores
from evoros.executor.protocol import Pool
from evoros.executor.remote import RemotePool

_ADDRESS = Rule(
    "the address of a dask scheduler, such as tcp://host:8786, the path of its scheduler file "
    "(.json), or null",
    lambda v: v is None or (isinstance(v, str) and ("://" in v or v.endswith(".json"))),
)


@dataclass(frozen=True)
@checked
class Dask(Limits):
    """Runs calls in the workers of a dask cluster: at ``address``, or a local one.

    Each thread of a dask worker has one process for calls. A call that crashes or hangs therefore
    costs that process only, as with ``Processes``. Calls of a worker that is lost itself run on
    another one. A call with which more workers end than dask's setting
    ``distributed.scheduler.allowed-failures`` is tried again while no other is suspected, and given
    up if it ends as many again. Workers may join and leave at any time.

    A worker whose Python, evoros, numpy, numba or arithmetic differs from the main process's gets
    no calls.
    """

    address: Annotated[str | None, _ADDRESS] = None
    workers: Annotated[int | None, null_or_whole(0)] = None  # of a local cluster

    def __post_init__(self) -> None:
        if self.address is not None and self.workers:
            raise InputError(
                f"executor.workers: must be null with an address, because the cluster has its own "
                f"workers, not {self.workers}; leave it out, or leave executor.address out"
            )

    @contextmanager
    def open(self) -> Iterator[Pool]:
        """Connect to the scheduler, or start a local cluster.

        Leaving the context ends all calls, and the local cluster.

        Raises:
            InputError: dask is not installed.
            RunStopped: nobody answers at the address.
        """
        with require_extra("dask", "executor=dask"):
            from evoros.executor import dask_cluster
        with ExitStack() as stack:
            stack.enter_context(dask_cluster.silence())
            address = self.address
            if address is None:
                workers = self.workers or available_cores()
                address = stack.enter_context(dask_cluster.start_cluster(workers))
            transport = stack.enter_context(dask_cluster.connect(address))
            pool = RemotePool(transport, self, shares_files=self.address is None)
            yield stack.enter_context(closing(pool))
