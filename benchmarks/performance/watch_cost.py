"""Measures what an open page of ``evoros watch`` costs the run that it follows.

The same evolution runs by turns alone and watched, with one that asks as an open page does. Its
processor time, workers included, is compared in pairs, as the machine may be busy. The missions
must be the same bytes:

    python benchmarks/performance/watch_cost.py [pairs] [override ...]
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from threading import Event, Thread
from urllib.request import urlopen

PAIRS, LOOK_S = 8, 2.0
EVOROS = (sys.executable, "-m", "evoros")
RUN = (
    *("optimizer.population_size=8", "optimizer.generations=8", "trials=6"),
    *("executor.workers=1", "figures=[]"),
)


def evolve(folder: Path, overrides: list[str]) -> float:
    """Run the evolution and return its processor time with that of its workers [s]."""
    command = [*EVOROS, *RUN, *overrides, f"hydra.run.dir={folder}"]
    null = subprocess.DEVNULL
    process = subprocess.Popen(command, stdout=null, stderr=null)
    _, status, used = os.wait4(process.pid, 0)
    assert status == 0, f"{folder}: ended with status {status}"
    return used.ru_utime + used.ru_stime


@contextmanager
def watch(folder: Path, used: list[float]) -> Iterator[None]:
    """Watch a folder with an open page; add the processor time of the watcher [s]."""
    process = subprocess.Popen([*EVOROS, "watch", str(folder)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    closed = Event()
    page = Thread(target=read_page, args=(process.stdout.readline().strip(), closed))
    page.start()
    try:
        yield
    finally:
        closed.set()
        page.join()
        process.terminate()
        _, _, usage = os.wait4(process.pid, 0)
        used.append(usage.ru_utime + usage.ru_stime)


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


def measure(base: Path, pair: int, overrides: list[str]) -> tuple[float, float, float, float]:
    """Return the times alone, watched, of the watcher [s], and the wall clock while watched."""
    alone, watched = (base / f"{kind}-{pair}" for kind in ("alone", "watched"))
    times, used, wall_s = {}, list[float](), 0.0
    for folder in (alone, watched) if pair % 2 else (watched, alone):
        if folder == alone:
            times[folder] = evolve(folder, overrides)
            continue
        begun_s = time.monotonic()
        with watch(folder, used):
            times[folder] = evolve(folder, overrides)
            time.sleep(LOOK_S)
        wall_s = time.monotonic() - begun_s
    tables = [(folder / "missions.csv").read_bytes() for folder in (alone, watched)]
    assert tables[0] == tables[1], "the missions differ"
    return times[alone], times[watched], used[0], wall_s


def main() -> None:
    """Print each pair, and the median of the ratios."""
    pairs = int(sys.argv[1]) if len(sys.argv) > 1 else PAIRS
    ratios, shares = [], []
    with TemporaryDirectory() as base:
        evolve(Path(base) / "first", sys.argv[2:])  # compiles what is not cached
        for pair in range(pairs):
            alone, watched, used, wall_s = measure(Path(base), pair, sys.argv[2:])
            ratios.append(watched / alone)
            shares.append(used / wall_s)
            print(
                f"alone {alone:6.2f} s  watched {watched:6.2f} s  ratio {ratios[-1]:.4f}  "
                f"watcher {used:5.2f} s in {wall_s:.0f} s",
                flush=True,
            )
    low, high = min(ratios), max(ratios)
    print(f"ratio: median {median(ratios):.4f}, {low:.4f} to {high:.4f}, of {pairs} pairs")
    print(f"the watcher uses {100 * median(shares):.0f} % of a core")


if __name__ == "__main__":
    main()
