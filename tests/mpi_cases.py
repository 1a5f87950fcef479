"""MPI jobs on this machine, which talk over loopback only."""

import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

SETTINGS = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_btl": "self,vader,tcp",
    "OMPI_MCA_btl_tcp_if_include": "lo",
    "OMPI_MCA_oob_tcp_if_include": "lo",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMPI_MCA_hwloc_base_binding_policy": "none",
    "OMPI_MCA_odls_base_sigkill_timeout": "5",  # seconds to say how to go on
    "PYTHONUNBUFFERED": "1",
}


def start_job(
    ranks: int,
    words: Sequence[str],
    folder: Path,
    last: Mapping[str, str] | None = None,
    environment: Mapping[str, str] | None = None,
) -> "subprocess.Popen[str]":
    """Start Python under ``mpi4py.futures``; ``last`` are variables of the last rank only, and
    ``environment`` those of all.
    """
    job = [sys.executable, "-m", "mpi4py.futures", *words]
    parts = ["-n", str(ranks), *job]
    if last:
        changed = [word for name, value in last.items() for word in ("-x", f"{name}={value}")]
        parts = ["-n", str(ranks - 1), *job, ":", "-n", "1", *changed, *job]
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.Popen(
        ["mpiexec", *parts],
        cwd=folder,
        env={**clean, **SETTINGS, **(environment or {})},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
