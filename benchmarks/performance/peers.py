"""Runs evoros and its peers by turns on one core: a lidar robot among discs, without records.

A robot with a two-wheel drive circles at 0.3 m/s in the middle of an arena. Its lidar scans all
around at 10 Hz up to 5 m; its motion and its contacts are computed every 20 ms. Each peer runs in
its own process, pinned to one core. The table has simulated seconds per processor second (median,
minimum and maximum of the repeats), and the maximum error of the peer's first scan.

    pip install -e '.[peers]'
    python benchmarks/performance/peers.py [--repeats 3] [--only NAME]

The lines below the table state what each peer does differently.
"""

import argparse
import json
import math
import os
import platform
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from statistics import median
from time import process_time

import numpy as np
from peer_scenes import PEERS, STEP_S, STEPS_PER_SCAN, Scene

SHORTEST_S = 2.0  # [s] processor time of a measurement
BEAMS, DISCS = (10, 150, 1000), (0, 60, 2000)
VERSIONS = {
    "evoros": "",
    "navground": "0.7.0",
    "ir-sim": "2.12.0",
    "mujoco": "",
    "pybullet": "",
}
DIFFERENCES = {
    "evoros": "float64; cylinders with a height; contact of the footprint with every disc",
    "navground": "float32; discs; follows a square of waypoints; two calls of Python a scan",
    "ir-sim": "float64 with GEOS geometries; steps of 100 ms, as its lidar scans at every step",
    "mujoco": "float64; rangefinder of each beam by mj_ray; pose set, contacts by mj_step1",
    "pybullet": "rayTestBatch, float32 geometry; pose set, contacts by performCollisionDetection",
}


def measure(name: str, scene: Scene) -> dict[str, float]:
    """Return a peer's simulated seconds per processor second, and the error of its first scan."""
    run, scan = PEERS[name](scene)
    error = (
        float(np.abs(scan - scene.scan_exactly()).max())
        if scan.shape == (scene.beams,)
        else math.nan
    )
    scans, spent = 1, 0.0
    while spent < SHORTEST_S:
        begin = process_time()
        run(scans)
        spent = process_time() - begin
        done, scans = scans, max(2 * scans, int(1.2 * scans * SHORTEST_S / max(spent, 1e-3)))
    return {"pace": done * STEP_S * STEPS_PER_SCAN / spent, "error_m": error}


def find_fault(name: str) -> str:
    """Return why a peer cannot run here, or runs in another version than measured."""
    try:
        found = version("mujoco-core" if name == "mujoco" else name)
    except PackageNotFoundError:
        return f"{name}: not installed; pip install -e '.[peers]' installs it; left out"
    wanted = VERSIONS[name]
    return f"{name}: version {found}, tried with {wanted}" if wanted not in ("", found) else ""


def run_alone(name: str, scene: Scene) -> dict[str, float]:
    """Measure a peer in a process of its own on the last core."""
    words = [sys.executable, __file__, "--child", name, json.dumps(asdict(scene))]
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    done = subprocess.run(words, capture_output=True, text=True, env={**os.environ, **threads})
    if done.returncode:
        raise RuntimeError((done.stderr.strip().splitlines() or ["no message"])[-1])
    result: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return result


def list_scenes() -> Iterator[Scene]:
    """Yield the scenes: each number varied alone, then both largest."""
    yield from (Scene(beams, 60) for beams in BEAMS)
    yield from (Scene(150, discs) for discs in DISCS if discs != 60)


def main() -> None:
    """Print the table, or measure one peer as a child."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--only", action="append", choices=PEERS)
    parser.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
        name, scene = options.child
        print(json.dumps(measure(name, Scene(**json.loads(scene)))))
        return
    faults = {name: find_fault(name) for name in options.only or PEERS}
    print("\n".join(filter(None, faults.values())))
    names = [name for name, fault in faults.items() if "not installed" not in fault]
    print(f"{platform.processor() or platform.machine()}, load {os.getloadavg()[0]:.1f}")
    print("| beams | discs | peer | simulated s / processor s | error of a scan [m] |")
    print("|---|---|---|---|---|")
    for scene in list_scenes():
        results: dict[str, list[dict[str, float]]] = {name: [] for name in names}
        for _ in range(options.repeats):
            for name in names:
                try:
                    results[name].append(run_alone(name, scene))
                except RuntimeError as fault:
                    print(f"{name}, {scene}: {fault}", file=sys.stderr)
        for name, found in results.items():
            if found:
                paces = [one["pace"] for one in found]
                spread = f"{median(paces):,.0f} ({min(paces):,.0f} to {max(paces):,.0f})"
                error = max(one["error_m"] for one in found)
                print(
                    f"| {scene.beams} | {scene.discs} | {name} | {spread} | {error:.1e} |",
                    flush=True,
                )
    print("\n".join(f"{name}: {DIFFERENCES[name]}" for name in names))


if __name__ == "__main__":
    main()
