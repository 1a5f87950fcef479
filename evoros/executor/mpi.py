"""Runs calls in the ranks of an MPI job."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import POSITIVE, WHOLE, checked
from evoros.base.errors import InputError
from evoros.executor.attempts import Limits, null_or_whole
from evoros.executor.protocol import Pool
from evoros.executor.remote import RemotePool


@dataclass(frozen=True)
@checked
class Mpi:
    """Runs calls in the ranks of an MPI job but the first, which is the main process.

    The job is started by ``mpiexec -n RANKS python -m mpi4py.futures -m evoros ...``. Each rank has
    a process of its own for calls. A call that crashes or hangs therefore costs that process only,
    as with ``Processes``, and the fields mean the same. MPI ends the whole job when a rank is lost.
    A rank that is silent for a minute ends the run, because MPI cannot do without it.

    Raises:
        InputError: a value breaks its rule.
    """

    time_limit_s: Annotated[float, POSITIVE] = 600.0  # wall clock, of one attempt at one call
    retries: Annotated[int, WHOLE] = 1  # at a call that crashed, hung or raised PilotLost
    calls_per_worker: Annotated[int | None, null_or_whole(1)] = None

    @contextmanager
    def open(self) -> Iterator[Pool]:
        """Take the ranks. Ranks end the calls that they have begun, also after it is left.

        Raises:
            InputError: mpi4py or an MPI library is not installed.
            RunStopped: this process was not started as the first rank of a job.
        """
        try:
            from evoros.executor import mpi_transport
        except (ImportError, RuntimeError) as error:  # a RuntimeError: there is no MPI library
            raise InputError(
                f"executor=mpi: needs mpi4py and an MPI library ({error}); type: pip install "
                f"'evoros[mpi]' && sudo apt-get install openmpi-bin libopenmpi-dev"
            ) from error
        limits = Limits(self.time_limit_s, self.retries, self.calls_per_worker)
        with ExitStack() as stack:
            transport = stack.enter_context(mpi_transport.connect())
            pool = RemotePool(transport, limits, shares_files=False)
            stack.callback(pool.close)
            yield pool
