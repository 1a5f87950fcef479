"""Measures how many missions one main process keeps up with, and what each executor costs.

    python benchmarks/fleet/throughput.py FOLDER [MODE ...]

Missions of ``evoros-evaluate`` are replaced by a sleep, or by nothing; everything else is real:
their plan, calls, answers and rows on disk. Simulated workers are threads of dask workers that
sleep themselves and start no processes, so that hundreds fit on one machine. Scheduler, simulated
workers and main process share its cores. Prints tables in Markdown for docs/performance.md. Modes:
``overhead`` and ``throughput``; ``measure`` is for one row, in a process that the others start.
"""

import json
import os
import pickle
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from evoros.cli.evaluate import evaluate
from evoros.evolution import calls, dispatch
from evoros.executor.node import Request
from evoros.executor.payload import MISSING, RETURNED, Kept, MissingError, Shared, unpack_call
from evoros.mission.mission import Mission
from evoros.mission.rollout import run_mission

LOOPBACK = ("--host", "127.0.0.1", "--no-dashboard")
KEPT = Kept()
OUTCOMES: dict[bytes, Any] = {}
SLEEP = "EVOROS_BENCHMARK_SLEEP_S"


def sleep_for_outcomes(
    packed: Shared, missions: Sequence[Mission], seconds: float, sleep_s: float
) -> list[calls.CallResult]:
    """Stand in for ``run_for_outcomes``: each mission sleeps and has the outcome of the first."""
    if packed.digest not in OUTCOMES:
        OUTCOMES[packed.digest] = run_mission(calls._unpack(packed), missions[0])[0]
    end, done = time.perf_counter() + seconds, 0
    while done < len(missions) and (not done or time.perf_counter() < end):
        if sleep_s:
            time.sleep(sleep_s)
        done += 1
    return [(OUTCOMES[packed.digest], None)] * done


class Replaced:
    """``sleep_for_outcomes`` with the time to sleep."""

    def __init__(self, sleep_s: float) -> None:
        self.sleep_s = sleep_s

    def __call__(
        self, packed: Shared, missions: Sequence[Mission], seconds: float, keep: bool
    ) -> list[calls.CallResult]:
        """Sleep for each mission."""
        return sleep_for_outcomes(packed, missions, seconds, self.sleep_s)


def answer_in_thread(wanted: dict[str, str], request: bytes) -> tuple[int, bytes, bool, str]:
    """Stand in for ``dask_transport.answer``: run the call in this thread."""
    from distributed import get_worker

    told: Request = pickle.loads(request)
    KEPT.add(told.contents)
    try:
        function, args = unpack_call(told.payload, KEPT)
    except MissingError:
        return MISSING, b"", True, get_worker().address
    return RETURNED, pickle.dumps(function(*args)), True, get_worker().address


def measure(arguments: Sequence[str], sleep_s: float | None, threads: bool) -> dict[str, float]:
    """Run an evaluation with replaced missions (None: with real ones); returns the rate.

    It is that between a fifth and nine tenths of the missions: without the start of the workers,
    and without the end, at which some have no work.
    """
    counts: list[tuple[float, int]] = []  # missions that have ended by a time
    patched: Any = dispatch
    original = patched.Dispatcher.run

    def timed(self: Any, *args: Any) -> Iterator[Any]:
        for results in original(self, *args):
            yield results
            before = counts[-1][1] if counts else 0
            counts.append((time.perf_counter(), before + len(results)))

    patched.Dispatcher.run = timed
    if sleep_s is not None:
        patched.run_for_outcomes = Replaced(sleep_s)
    if threads:
        from evoros.executor import dask_transport

        dask_transport.answer = answer_in_thread
    cpu, wall = time.process_time(), time.perf_counter()
    status = evaluate(arguments)
    if status:
        raise SystemExit(status)
    total = counts[-1][1]
    middle = [each for each in counts if 0.2 * total <= each[1] <= 0.9 * total]
    (begun, first), (ended, last) = middle[0], middle[-1]
    busy = (time.process_time() - cpu) / (time.perf_counter() - wall)
    return {"missions": total, "rate": (last - first) / (ended - begun), "cpu": busy}


def run_row(words: Sequence[str], launcher: Sequence[str] = ()) -> dict[str, float]:
    """Measure in a fresh process, below a launcher such as that of MPI."""
    done = subprocess.run(
        [*(launcher or [sys.executable]), __file__, *words],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise SystemExit(done.stderr)
    row: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return row


def start_cluster(folder: Path, workers: int) -> list["subprocess.Popen[bytes]"]:
    """Start a scheduler and dask workers with so many threads in all."""
    file = folder / "scheduler.json"
    file.unlink(missing_ok=True)
    python = [sys.executable, "-m"]
    scheduler = [*python, "distributed.cli.dask_scheduler", *LOOPBACK, "--port", "0"]
    # dask's profiler would look at all threads a hundred times a second.
    quiet = {"DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False"}
    here = {**os.environ, **quiet, "PYTHONPATH": str(Path(__file__).parent)}
    command = [*scheduler, "--scheduler-file", str(file)]
    started = [subprocess.Popen(command, env=here, stderr=subprocess.DEVNULL)]
    nodes = max(1, workers // 64)
    worker = [*python, "distributed.cli.dask_worker", "--scheduler-file", str(file), *LOOPBACK]
    worker += ["--nthreads", str(workers // nodes), "--no-nanny", "--local-directory", str(folder)]
    while not file.exists():
        time.sleep(0.1)
    more = (subprocess.Popen(worker, env=here, stderr=subprocess.DEVNULL) for _ in range(nodes))
    started.extend(more)
    from distributed import Client

    with Client(scheduler_file=str(file)) as client:  # type: ignore[no-untyped-call]
        while sum(client.nthreads().values()) < nodes * (workers // nodes):
            time.sleep(0.1)
    return started


def measure_throughput(folder: Path, designs: Path) -> None:
    print("| mission s | workers | missions | missions/s | busy % | main process, CPU % |")
    print("|---|---|---|---|---|---|")
    for sleep_s, seconds in ((0.2, 20.0), (0.01, 10.0)):
        for workers in (2, 8, 64, 512):
            wanted = min(workers / sleep_s * seconds, 100_000)
            processes = start_cluster(folder, workers)
            try:
                row = run_row(
                    [
                        str(folder),
                        "measure",
                        str(sleep_s),
                        "threads",
                        "simulator=planar",
                        f"designs={designs}",
                        f"trials={max(1, int(wanted / 3))}",
                        "executor=dask",
                        f"executor.address={folder / 'scheduler.json'}",
                        f"hydra.run.dir={folder / f'sleep-{sleep_s}-{workers}'}",
                    ]
                )
            finally:
                for process in processes:
                    process.kill()
                    process.wait()
            rate, cpu = row["rate"], 100 * row["cpu"]
            busy = 100 * rate * sleep_s / workers
            print(
                f"| {sleep_s:g} | {workers} | {row['missions']:,.0f} | {rate:,.0f} | {busy:.1f} "
                f"| {cpu:.0f} |",
                flush=True,
            )


def measure_overhead(folder: Path, designs: Path) -> None:
    mpi = ["mpiexec", "--bind-to", "none", "-n", "3", sys.executable, "-m", "mpi4py.futures"]
    print("| executor | workers | us a mission that does nothing | planar missions/s |")
    print("|---|---|---|---|")
    for name, options, launcher in (
        ("serial", [], []),
        ("processes", ["executor.workers=2"], []),
        ("dask", ["executor.workers=2"], []),
        ("mpi", [], mpi),
    ):
        rows = []
        for sleep, trials in (("0", 20_000), ("none", 400)):
            run = folder / f"{name}-{sleep}"
            words = [
                "simulator=planar",
                f"designs={designs}",
                f"trials={trials}",
                f"executor={name}",
                *options,
            ]
            words += [f"hydra.run.dir={run}"]
            rows.append(run_row([str(folder), "measure", sleep, "processes", *words], launcher))
        nothing, planar = (1 / row["rate"] for row in rows)
        workers = 1 if name == "serial" else 2
        print(f"| {name} | {workers} | {1e6 * nothing:.0f} | {1 / planar:,.0f} |", flush=True)


def main() -> None:
    folder, modes = Path(sys.argv[1]).resolve(), sys.argv[2:] or ["overhead", "throughput"]
    if modes[0] == "measure":
        import throughput  # not __main__, which no worker has

        _, sleep, how, *arguments = modes
        sleep_s = None if sleep == "none" else float(sleep)
        row = throughput.measure(arguments, sleep_s, how == "threads")
        print(json.dumps(row))
        return
    folder.mkdir(parents=True)
    designs = folder / "designs"
    command = ["evoros", "simulator=planar", "optimizer.generations=1", "figures=[]"]
    command.append(f"hydra.run.dir={designs}")
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    for mode in modes:
        {"overhead": measure_overhead, "throughput": measure_throughput}[mode](folder, designs)
        print()


if __name__ == "__main__":
    main()
