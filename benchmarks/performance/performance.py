"""Measures how fast evoros is: both simulators, workers, a generation, a tick, the start.

Runs the commands that users type, including their records on disk, for random designs in the three
environments of the case study. Takes a few minutes. Writes the tables of docs/performance.md
between its marks and draws docs/img/performance.png:

    python benchmarks/performance/performance.py [--quick]
"""

import csv
import json
import os
import platform
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from time import perf_counter

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import tick_cost
from tick_cost import Point

from evoros.analysis.drawing.style import write_png
from evoros.base.rng import generator
from evoros.config.compose import compose
from evoros.executor.processes import available_cores
from evoros.storage.champion_files import design_table
from evoros.storage.circumstances import processor

ROOT = Path(__file__).parents[2]
REPORT, FIGURE = ROOT / "docs" / "performance.md", ROOT / "docs" / "img" / "performance.png"
BEGIN, END = "<!-- measured -->", "<!-- end -->"
SIZES = {"planar": (100, 4), "pybullet": (10, 1)}  # designs, trials
QUICK = {"planar": (20, 1), "pybullet": (2, 1)}


@dataclass(frozen=True)
class Pace:
    """One run of evoros evaluate."""

    simulator: str
    workers: int
    missions: int
    simulated: float  # [s]
    running: float  # [s] wall clock, from the start of the workers
    whole: float  # [s] wall clock, from the start of the command

    @property
    def rate(self) -> float:
        """Simulated seconds per second of running."""
        return self.simulated / self.running


def command(*arguments: str, cache: Path | None = None) -> float:
    """Run a command of evoros and return its wall-clock time [s]."""
    environment = dict(os.environ)
    if cache is not None:
        environment["XDG_CACHE_HOME"] = str(cache)
    begin = perf_counter()
    subprocess.run(
        [str(Path(sys.executable).with_name("evoros")), *arguments],
        env=environment,
        check=True,
        capture_output=True,
    )
    return perf_counter() - begin


def random_designs(count: int, file: Path) -> None:
    """Write a file of designs for ``evoros evaluate``."""
    space, rng = compose([]).build().space, generator("0", "performance")
    designs = {i: space.decode(rng.random(space.size)) for i in range(count)}
    file.write_text(design_table(designs))


def pace(simulator: str, workers: int, designs: int, trials: int, folder: Path) -> Pace:
    """Evaluate random designs with ``evoros evaluate``."""
    file, run = folder / f"{designs}.csv", folder / f"{simulator}_{workers}"
    random_designs(designs, file)
    whole = command(
        "evaluate",
        f"designs={file}",
        f"trials={trials}",
        f"simulator={simulator}",
        f"executor.workers={workers}",
        f"hydra.run.dir={run}",
    )
    with (run / "missions.csv").open() as rows:
        times = [float(row["time_s"]) for row in csv.DictReader(rows)]
    running = json.loads((run / "status.json").read_text())["session_wall_s"]
    return Pace(simulator, workers, len(times), sum(times), running, whole)


def replicate(folder: Path) -> tuple[float, float, int]:
    """Run a whole replicate; returns its and a generation's wall time [s], and its missions."""
    run = folder / "replicate"
    whole = command("simulator=planar", "figures=[]", f"hydra.run.dir={run}")
    status = json.loads((run / "status.json").read_text())
    return whole, status["session_wall_s"] / status["generations"], status["missions"]


def start(folder: Path) -> tuple[float, float]:
    """The wall-clock time [s] of the shortest run, without and with cached machine code."""
    tiny = ("optimizer.population_size=2", "optimizer.generations=1")
    short = ("simulator=planar", "figures=[]", *tiny)
    cold, warm = (
        command(*short, f"hydra.run.dir={folder / name}", cache=folder / "cache")
        for name in ("cold", "warm")
    )
    return cold, warm


def report(
    paces: list[Pace],
    whole: tuple[float, float, int],
    starts: tuple[float, float],
    curves: dict[str, list[Point]],
) -> str:
    """The measured part of the page."""
    names = ("numba", "numpy", "pybullet")
    packages = ", ".join(f"{name} {version(name)}" for name in names)
    lines = [
        f"{processor()}, {available_cores()} cores; Python {platform.python_version()}, "
        f"{packages}; {platform.system()}.",
        "",
        "| simulator | workers | missions | simulated s | wall s, missions | wall s, command "
        "| simulated s/s |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {p.simulator} | {p.workers} | {p.missions:,} | {p.simulated:,.0f} | {p.running:.1f} "
        f"| {p.whole:.1f} | {p.rate:,.0f} |"
        for p in paces
    ]
    lines += [
        "",
        f"A whole replicate (`evoros figures=[]`, {whole[2]} missions): "
        f"{whole[0]:.1f} s, {whole[1]:.2f} s a generation.",
        "",
        f"The shortest run possible: {starts[0]:.1f} s without cached machine code, "
        f"{starts[1]:.1f} s with it.",
        "",
        tick_cost.table(curves),  # type: ignore[arg-type]
    ]
    return "\n".join(lines)


def draw(paces: list[Pace], curves: dict[str, list[Point]]) -> None:
    """Draw three panels of the cost of a tick and one of the gain from workers."""
    plt.rcParams.update({"font.size": 8, "axes.spines.top": False, "axes.spines.right": False})
    figure, axes = plt.subplots(1, 4, figsize=(7.2, 2.1), layout="constrained")
    for axis, (name, points) in zip(axes, curves.items(), strict=False):
        numbers, costs = np.array(points).T
        axis.plot(numbers, costs, "o-", color="#0072B2", ms=3, lw=1)
        axis.set(xlabel=name.capitalize(), ylim=(0, 1.15 * costs.max()))
        if name == "obstacles":
            axis.set_xscale("log")
    axes[0].set_ylabel("A control tick (µs)")
    for simulator, color in (("planar", "#0072B2"), ("pybullet", "#D55E00")):
        rates = sorted((p.workers, p.rate) for p in paces if p.simulator == simulator)
        axes[3].plot(*np.array(rates).T, "o-", color=color, ms=3, lw=1, label=simulator)
    axes[3].set(
        xlabel="Workers", ylabel="Simulated s/s", yscale="log", xticks=[w for w, _ in rates]
    )
    axes[3].legend(frameon=False)
    write_png(figure, FIGURE, dpi=200)


def main() -> None:
    sizes, cores = (QUICK if "--quick" in sys.argv else SIZES), available_cores()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        starts = start(folder)
        workers = sorted({1, 2, cores // 2, cores} - {0})
        paces = [pace(s, w, *size, folder) for s, size in sizes.items() for w in workers]
        whole = replicate(folder)
    curves = tick_cost.curves()
    measured = report(paces, whole, starts, curves)
    print(measured)
    draw(paces, curves)
    before, _, tail = REPORT.read_text().partition(BEGIN)
    after = tail.partition(END)[2]
    REPORT.write_text(f"{before}{BEGIN}\n\n{measured}\n\n{END}{after}")


if __name__ == "__main__":
    main()
