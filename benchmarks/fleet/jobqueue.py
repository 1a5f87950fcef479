"""A run whose workers are Slurm jobs that dask-jobqueue submits and replaces.

Run it where the run folder is to be, such as on the login node, with the arguments of evoros:

    python jobqueue.py hydra.run.dir=outputs/fleet
"""

import os
import subprocess
import sys

from dask_jobqueue.slurm import SLURMCluster

if __name__ == "__main__":
    with SLURMCluster(
        cores=2,  # of a job; each gets a process for missions
        processes=1,  # dask workers in a job: one is enough
        memory="2GB",
        walltime="01:00:00",
        interface=os.environ.get("FLEET_INTERFACE", "eth0"),
        job_directives_skip=["--mem"],  # this Slurm does not share out memory
    ) as cluster:
        cluster.adapt(minimum_jobs=1, maximum_jobs=2)
        address = f"executor.address={cluster.scheduler_address}"
        command = ["evoros", *sys.argv[1:], "executor=dask", address]
        sys.exit(subprocess.run(command, check=False).returncode)
