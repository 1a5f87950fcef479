"""Measures how many missions one main process keeps up with, and what each executor costs.

    python benchmarks/fleet/throughput.py FOLDER [MODE ...]

Missions of ``evoros evaluate`` are replaced by a sleep, or by nothing; everything else is real:
their plan, calls, answers and rows on disk. Simulated workers are threads of dask workers that
sleep themselves and start no processes, so that hundreds fit on one machine. Scheduler, simulated
workers and main process share its cores, so that the CPU time of each counts beside wall clock.
Prints tables in Markdown for docs/performance.md. Modes: ``overhead`` and ``throughput``;
``measure`` is for one row, in a process that the others start.
"""

import json
import os
import pickle
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

from evoros.base.rng import generator
from evoros.cli.command import evaluate
from evoros.config.compose import compose
from evoros.dispatch import calls, dispatcher
from evoros.executor.protocol import MISSING, RETURNED, Kept, MissingError, Shared, unpack_call
from evoros.mission.mission import Mission
from evoros.mission.rollout import run_mission
from evoros.plugins.clusters.companion import Request
from evoros.storage.champion_files import design_table

LOOPBACK = ("--host", "127.0.0.1", "--no-dashboard")
KEPT = Kept()
OUTCOMES: dict[bytes, Any] = {}
DESIGNS = 300
ROUNDS = 3
SIMULATED = ((0.2, 2, 60), (0.2, 8, 60), (0.2, 64, 60), (0.2, 512, 90), (0.015, 100, 60))
"""Time of a mission [s], workers, and time of the row [s]. A planar mission takes about 0.015 s."""


def sleep_for_outcomes(
    packed: Shared, missions: Sequence[Mission], seconds: float, sleep_s: float
) -> calls.CallAnswer:
    """Stand in for ``run_for_outcomes``: each mission sleeps and has the outcome of the first."""
    if packed.digest not in OUTCOMES:
        OUTCOMES[packed.digest] = run_mission(calls.unpack(packed), missions[0])[0]
    begun, done = time.perf_counter(), 0
    end = begun + seconds
    while done < len(missions) and (not done or time.perf_counter() < end):
        done += 1
        # Until a point in time: a thread that wakes late, because others run, catches up.
        time.sleep(max(0.0, begun + done * sleep_s - time.perf_counter()))
    # Copies, because pickle would write and read one outcome once.
    results: list[calls.CallResult] = [
        (replace(OUTCOMES[packed.digest]), None) for _ in range(done)
    ]
    return calls.CallAnswer(results, done, time.perf_counter() - begun)


class Replaced:
    """``sleep_for_outcomes`` with the time to sleep."""

    def __init__(self, sleep_s: float) -> None:
        self.sleep_s = sleep_s

    def __call__(
        self, packed: Shared, missions: Sequence[Mission], seconds: float, keep: bool
    ) -> calls.CallAnswer:
        """Sleep for each mission."""
        return sleep_for_outcomes(packed, missions, seconds, self.sleep_s)


def answer_in_thread(wanted: dict[str, str], request: bytes) -> tuple[int, bytes, bool, str]:
    """Stand in for ``dask_sending.answer``: run the call in this thread."""
    from distributed import get_worker

    told: Request = pickle.loads(request)
    KEPT.add(told.contents)
    try:
        function, args = unpack_call(told.payload, KEPT)
    except MissingError:
        return MISSING, b"", True, get_worker().address
    return RETURNED, pickle.dumps(function(*args)), True, get_worker().address


def measure(arguments: Sequence[str], sleep_s: float | None, threads: bool) -> dict[str, float]:
    """Run an evaluation with replaced missions (None: with real ones).

    Returns missions a second, the CPU time of this process in us a mission, and how many workers
    were busy with missions, all between a fifth and nine tenths of the missions: without the start
    of the workers, and without the end, at which some have no work.
    """
    counts: list[tuple[float, float, float, int]] = []  # wall, CPU and busy time, missions so far
    patched: Any = dispatcher
    original, note, busy_s = patched.Dispatcher.run, patched.Pace.note, 0.0

    def noted(self: Any, finished: int, timed: int, seconds: float) -> None:
        nonlocal busy_s
        busy_s += seconds
        note(self, finished, timed, seconds)

    def timed(self: Any, *args: Any) -> Iterator[Any]:
        for results in original(self, *args):
            yield results
            before = counts[-1][-1] if counts else 0
            now = time.perf_counter(), time.process_time()
            counts.append((*now, busy_s, before + len(results)))

    patched.Dispatcher.run, patched.Pace.note = timed, noted
    if sleep_s is not None:
        patched.run_for_outcomes = Replaced(sleep_s)
    if threads:
        from evoros.plugins.clusters import dask_transport

        dask_transport.answer = answer_in_thread
    status = evaluate(arguments)
    if status:
        raise SystemExit(status)
    total = counts[-1][-1]
    middle = [count for count in counts if 0.2 * total <= count[-1] <= 0.9 * total]
    wall, cpu, busy, missions = (b - a for a, b in zip(middle[0], middle[-1], strict=True))
    return {
        "missions": total,
        "rate": missions / wall,
        "cpu_us": 1e6 * cpu / missions,
        "busy": busy / wall,
    }


def write_designs(file: Path) -> None:
    """Write a table of random designs."""
    space, rng = compose(["simulator=planar"]).build().space, generator("0", "fleet")
    designs = {i: space.decode(rng.random(space.size)) for i in range(DESIGNS)}
    file.write_text(design_table(designs))


def read_cpu(pid: int) -> float:
    """Return the CPU time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def run_row(words: Sequence[str]) -> dict[str, float]:
    """Measure in a fresh process."""
    done = subprocess.run(
        [sys.executable, __file__, *words],
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

    with Client(scheduler_file=str(file)) as client:
        while sum(client.nthreads().values()) < nodes * (workers // nodes):
            time.sleep(0.1)
    return started


def measure_simulated(folder: Path, sleep_s: float, workers: int, wanted: float) -> None:
    processes = start_cluster(folder, workers)
    try:
        words = [
            "simulator=planar",
            f"designs={folder / 'designs.csv'}",
            f"trials={max(1, round(wanted / 3 / DESIGNS))}",
            "executor=dask",
            f"executor.address={folder / 'scheduler.json'}",
            f"hydra.run.dir={folder / f'sleep-{sleep_s}-{workers}'}",
        ]
        begun, before = time.perf_counter(), [read_cpu(process.pid) for process in processes]
        row = run_row([str(folder), "measure", str(sleep_s), "threads", *words])
        wall = time.perf_counter() - begun
        used = [read_cpu(process.pid) - cpu for process, cpu in zip(processes, before, strict=True)]
    finally:
        for process in processes:
            process.kill()
            process.wait()
    rate = row["rate"]
    print(
        f"| {sleep_s:g} | {workers} | {row['missions']:,.0f} | {rate:,.0f} "
        f"| {100 * row['busy'] / workers:.1f} | {row['cpu_us']:.0f} "
        f"| {1e6 * used[0] / row['missions']:.0f} | {sum(used[1:]) / wall:.2f} "
        f"| {os.getloadavg()[0]:.1f} |",
        flush=True,
    )


def measure_throughput(folder: Path) -> None:
    print(
        "| mission s | workers | missions | missions/s | busy % | us a mission, main process ",
        end="",
    )
    print("| us a mission, scheduler | cores, simulated workers | load |")
    print("|---|---|---|---|---|---|---|---|---|")
    for sleep_s, workers, seconds in SIMULATED:
        measure_simulated(folder, sleep_s, workers, workers / sleep_s * seconds)


def measure_overhead(folder: Path) -> None:
    executors: list[tuple[str, list[str]]] = [
        ("serial", []),
        ("processes", ["executor.workers=2"]),
        ("dask", ["executor.workers=2"]),
    ]
    rows: dict[tuple[str, str], list[dict[str, float]]] = {}
    for index in range(ROUNDS):  # in turn, so that other programs disturb all of them
        for name, options in executors:
            for sleep, trials in (("0", 200), ("none", 2)):
                words = [
                    "simulator=planar",
                    f"designs={folder / 'designs.csv'}",
                    f"trials={trials}",
                    f"executor={name}",
                    *options,
                    f"hydra.run.dir={folder / f'{name}-{sleep}-{index}'}",
                ]
                row = run_row([str(folder), "measure", sleep, "processes", *words])
                rows.setdefault((name, sleep), []).append(row)
    print(
        "| executor | workers | us a mission that does nothing | CPU us of it, main process ",
        end="",
    )
    print("| planar missions/s | load |")
    print("|---|---|---|---|---|---|")
    for name, _ in executors:
        nothing = median(1e6 / row["rate"] for row in rows[name, "0"])
        cpu = median(row["cpu_us"] for row in rows[name, "0"])
        planar = median(row["rate"] for row in rows[name, "none"])
        workers, load = 1 if name == "serial" else 2, os.getloadavg()[0]
        print(f"| {name} | {workers} | {nothing:.0f} | {cpu:.0f} | {planar:,.0f} | {load:.1f} |")


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
    write_designs(folder / "designs.csv")
    for mode in modes:
        {"overhead": measure_overhead, "throughput": measure_throughput}[mode](folder)
        print()


if __name__ == "__main__":
    main()
