"""The command with less patience for a scheduler that is gone; a process of its own runs it."""

from evoros.cli.main import main
from evoros.executor import dask_cluster, dask_transport

__all__ = ["main"]

PATIENCE_S = 2.0

dask_cluster.CONNECT_S = dask_transport.CONNECT_S = PATIENCE_S
