"""A dask cluster of real processes on loopback, in which tests break things."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from executor_calls import wait_until

LIMIT_S = 120.0
LOOPBACK = ("--host", "127.0.0.1", "--dashboard-address", "127.0.0.1:0")
SETTINGS = {
    "DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": "5s",  # a stopped worker is given up after it
    "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "5s",
    "DASK_DISTRIBUTED__COMM__TIMEOUTS__TCP": "12s",
}


@dataclass
class Cluster:
    """A scheduler and its workers; each is a process that knows nothing of the tests."""

    folder: Path
    address: str = ""
    scheduler: "subprocess.Popen[bytes] | None" = None
    workers: list["subprocess.Popen[bytes]"] = field(default_factory=list)

    @property
    def key(self) -> str:
        return f"executor.address={self.address}"

    def start(self, workers: int) -> None:
        file = self.folder / "scheduler.json"
        file.unlink(missing_ok=True)
        options = [*LOOPBACK, "--port", "0", "--scheduler-file", str(file)]
        self.scheduler = self._spawn("scheduler", options, {})
        assert wait_until(lambda: file.exists() and file.read_text().endswith("}"), LIMIT_S)
        self.address = json.loads(file.read_text())["address"]
        for _ in range(workers):
            self.add_worker()

    def add_worker(
        self, environment: Mapping[str, str] | None = None, *options: str
    ) -> "subprocess.Popen[bytes]":
        """Start a worker without a nanny, so that its process is the one that is killed."""
        here = str(self.folder / "scratch")
        words = [self.address, *LOOPBACK, "--nthreads", "1", "--local-directory", here, *options]
        if "--nanny" not in options:
            words.append("--no-nanny")
        self.workers.append(self._spawn("worker", words, environment or {}))
        return self.workers[-1]

    def _spawn(
        self, what: str, options: list[str], environment: Mapping[str, str]
    ) -> "subprocess.Popen[bytes]":
        clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        with (self.folder / f"{what}.log").open("ab") as log:
            return subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.dask_{what}", *options],
                cwd=self.folder,
                env={**clean, **SETTINGS, **environment},
                stdout=log,
                stderr=log,
            )

    def end(self) -> None:
        for process in (*self.workers, self.scheduler):
            if process is not None:
                process.kill()
                process.wait()
        self.workers, self.scheduler = [], None


@contextmanager
def cluster(folder: Path, workers: int) -> Iterator[Cluster]:
    started = Cluster(folder)
    try:
        started.start(workers)
        yield started
    finally:
        started.end()


def freeze(process: "subprocess.Popen[bytes]") -> None:
    process.send_signal(signal.SIGSTOP)
