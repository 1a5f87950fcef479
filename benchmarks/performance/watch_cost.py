"""Measures what an open page of ``evoros watch`` costs the run that it follows.

One long evolution runs on all cores while the page is stopped and continued by turns, at random
within each pair of blocks. What is compared in each pair is the simulated time per wall clock, so
that neither the start nor a machine that slowly changes matters. A page that is stopped for half of
the time still draws as often as its share of the processors allows, and thus twice as often in the
other half: a page that is open all the time costs half of what is measured. On a quiet machine:

    python benchmarks/performance/watch_cost.py [pairs] [override ...]
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from threading import Event, Thread
from urllib.request import urlopen

import numpy as np

import evoros

PAIRS, BLOCK_S, LOOK_S, START_S, RESAMPLES = 40, 8.0, 2.0, 5.0, 10_000
EVOROS = (sys.executable, "-m", "evoros")
RUN = (
    *("optimizer=random_search", "optimizer.population_size=8", "optimizer.generations=100000"),
    *("trials=6", "figures=[]"),
)
Block = tuple[bool, int, int]  # watched; begin and end [ns]


@contextmanager
def evolve(folder: Path, overrides: list[str]) -> Iterator[None]:
    """Let the evolution run meanwhile."""
    null = subprocess.DEVNULL
    command = [*EVOROS, *RUN, *overrides, f"hydra.run.dir={folder}"]
    process = subprocess.Popen(command, stdout=null, stderr=null)
    try:
        yield
        assert process.poll() is None, f"the run has ended with status {process.returncode}"
    finally:
        process.terminate()
        process.wait()


@contextmanager
def watch(folder: Path) -> Iterator[int]:
    """Watch a folder with an open page; yield the process of the page."""
    process = subprocess.Popen([*EVOROS, "watch", str(folder)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    address = process.stdout.readline().strip()
    closed = Event()
    reader = Thread(target=read_page, args=(address, closed))
    reader.start()
    try:
        yield process.pid
    finally:
        closed.set()
        reader.join()
        process.terminate()
        process.wait()


def read_page(address: str, closed: Event) -> None:
    """Ask as the page does: for the state, and for the parts that have changed."""
    known: dict[str, str] = {}
    read(address)
    while not closed.wait(LOOK_S):
        for name, digest in json.loads(read(f"{address}state"))["parts"]:
            if known.get(name) != digest:
                read(f"{address}part/{name}")
                known[name] = digest


def read(address: str) -> bytes:
    with urlopen(address, timeout=60) as answer:
        content: bytes = answer.read()
        return content


def alternate(page: int, pairs: int) -> list[Block]:
    """Stop and continue the page by turns, and return the blocks."""
    blocks, random = [], Random(0)
    for _ in range(pairs):
        first = random.random() < 1 / 2
        for watched in (first, not first):
            os.kill(page, signal.SIGCONT if watched else signal.SIGSTOP)
            begin = time.time_ns()
            time.sleep(BLOCK_S)
            blocks.append((watched, begin, time.time_ns()))
    os.kill(page, signal.SIGCONT)
    return blocks


def compare(folder: Path, blocks: list[Block]) -> np.ndarray:
    """Return the log ratios of the speeds, watched over alone, of the pairs; shape (pairs,)."""
    missions = evoros.load_run(folder).missions
    work_s = missions.groupby("generation").time_s.sum()
    ends = [path.stat().st_mtime_ns for path in sorted((folder / "generations").glob("*.csv"))]
    speeds = []
    for _, begin, end in blocks:
        whole = [g for g in range(1, len(ends)) if begin <= ends[g - 1] and ends[g] <= end]
        wall_s = sum(ends[g] - ends[g - 1] for g in whole) / 1e9
        speeds.append(sum(work_s[g] for g in whole) / wall_s)
    signs = [1 if watched else -1 for watched, _, _ in blocks]
    ratios: np.ndarray = (np.log(speeds) * signs).reshape(-1, 2).sum(axis=1)
    return ratios


def processor_s(process: int) -> float:
    """Return the processor time of a process and of its children that have ended [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    """Print the cost with its bootstrap interval, and the processor time of the page."""
    pairs = int(sys.argv[1]) if len(sys.argv) > 1 else PAIRS
    with TemporaryDirectory() as base, evolve(folder := Path(base) / "run", sys.argv[2:]):
        with watch(folder) as page:
            time.sleep(START_S)
            used_s, begin_s = processor_s(page), time.monotonic()
            blocks = alternate(page, pairs)
            used_s = processor_s(page) - used_s
            wall_s = time.monotonic() - begin_s
        ratios = compare(folder, blocks)
    means = np.random.default_rng(0).choice(ratios, (RESAMPLES, pairs)).mean(axis=1)
    low, high = np.quantile(means, (0.025, 0.975))
    cost = [f"{100 * (1 - np.exp(ratio)) / 2:.2f}" for ratio in (ratios.mean(), high, low)]
    print(f"the run is slower by {cost[0]} % [{cost[1]}, {cost[2]}], {pairs} pairs of blocks")
    print(f"the page used {used_s / wall_s:.3f} of a core")


if __name__ == "__main__":
    main()
