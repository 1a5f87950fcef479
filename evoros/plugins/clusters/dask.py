"""An executor that runs calls in the workers of a Dask cluster."""

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import Rule, checked, null_or_whole
from evoros.base.errors import InputError, require_extra
from evoros.executor.processes import available_cores
from evoros.executor.protocol import Executor, Pool
from evoros.executor.worker_handle import Limits
from evoros.plugins.clusters.remote import RemotePool

_ADDRESS = Rule(
    "the address of a Dask scheduler, such as tcp://host:8786, the path of its scheduler file "
    "(.json), or null",
    lambda v: v is None or (isinstance(v, str) and ("://" in v or v.endswith(".json"))),
)


@dataclass(frozen=True)
@checked
class Dask(Limits, Executor):
    """An executor that runs calls in workers of the Dask cluster at ``address``, or of a local one.

    Each thread of a Dask worker has one process for calls, so that a crash costs only that process,
    as with ``Processes``. The calls of a lost worker run on another. A call that loses more workers
    than ``distributed.scheduler.allowed-failures`` is retried alone, and fails if it loses as many
    again. Workers may join and leave at any time; they receive no calls if their Python, evoros,
    numpy, numba or arithmetic differs.
    """

    address: Annotated[str | None, _ADDRESS] = None
    workers: Annotated[int | None, null_or_whole(0)] = None  # number of workers in a local cluster

    def __post_init__(self) -> None:
        if self.address is not None and self.workers:
            raise InputError(
                f"executor.workers: must be null, not {self.workers}, if executor.address is set, "
                f"because the cluster at that address has its own workers; remove one of the keys"
            )

    @contextmanager
    def open(self) -> Iterator[Pool]:
        """Connect to the scheduler or start a local cluster; end all calls on exit."""
        with require_extra("dask", "executor=dask"):
            from evoros.plugins.clusters import dask_transport
        with ExitStack() as stack:
            stack.enter_context(dask_transport.silence())
            address = self.address
            if address is None:
                local = dask_transport.start_cluster(self.workers or available_cores())
                address = stack.enter_context(local)
            transport = stack.enter_context(dask_transport.connect(address))
            pool = RemotePool(transport, self, shares_files=self.address is None)
            yield stack.enter_context(closing(pool))
