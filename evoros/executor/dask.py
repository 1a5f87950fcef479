"""Runs calls in the workers of a dask cluster, which may come and go."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import POSITIVE, WHOLE, Rule, checked
from evoros.base.errors import InputError
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
class Dask:
    """Runs calls in the workers of a dask cluster: that of ``address``, or a local one.

    Each thread of a dask worker has a process of its own for calls. A call that crashes or hangs
    therefore costs that process only, as with ``Processes``, and ``time_limit_s``, ``retries`` and
    ``calls_per_worker`` mean the same. Calls of a worker that is lost itself run on another one. A
    call with which more workers end than dask's setting ``distributed.scheduler.allowed-failures``
    is tried again while no other is suspected, and given up if it ends as many again. Workers may
    join and leave at any time.

    A worker whose Python, evoros, numpy, numba or arithmetic differs from those of the main
    process gets no calls.

    Raises:
        InputError: a value breaks its rule.
    """

    address: Annotated[str | None, _ADDRESS] = None
    workers: Annotated[int | None, null_or_whole(0)] = None  # of a local cluster
    time_limit_s: Annotated[float, POSITIVE] = 600.0  # wall clock, of one attempt at one call
    retries: Annotated[int, WHOLE] = 1  # at a call that crashed, hung or raised PilotLost
    calls_per_worker: Annotated[int | None, null_or_whole(1)] = None

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
        try:
            from evoros.executor import dask_cluster
        except ImportError as error:
            raise InputError(
                f"executor=dask: needs dask.distributed ({error}); type: pip install 'evoros[dask]'"
            ) from error
        limits = Limits(self.time_limit_s, self.retries, self.calls_per_worker)
        with ExitStack() as stack:
            stack.enter_context(dask_cluster.silence())
            address = self.address
            if address is None:
                workers = self.workers or available_cores()
                address = stack.enter_context(dask_cluster.start_cluster(workers))
            transport = stack.enter_context(dask_cluster.connect(address))
            pool = RemotePool(transport, limits, shares_files=self.address is None)
            stack.callback(pool.close)
            yield pool
