"""Runs calls in the ranks of an MPI job."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass

from evoros.base.checks import checked
from evoros.base.errors import InputError
from evoros.executor.attempts import Limits
from evoros.executor.protocol import Pool
from evoros.executor.remote import RemotePool


@dataclass(frozen=True)
@checked
class Mpi(Limits):
    """Runs calls in the ranks of an MPI job but the first, which is the main process.

    The job is started by ``mpiexec -n RANKS python -m mpi4py.futures -m evoros ...``. Each rank has
    one process for calls. A call that crashes or hangs therefore costs that process only, as with
    ``Processes``. MPI ends the whole job when a rank is lost. A rank that is silent for a minute
    ends the run, because MPI cannot do without it.
    """

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
        with (
            mpi_transport.connect() as transport,
            closing(RemotePool(transport, self, shares_files=False)) as pool,
        ):
            yield pool
