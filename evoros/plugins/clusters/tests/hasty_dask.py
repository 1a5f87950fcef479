"""The command with less patience for a scheduler that is gone; a process of its own runs it."""

from evoros.cli.main import main
from evoros.plugins.clusters import dask_transport

__all__ = ["main"]

dask_transport.CONNECT_S = 2.0
