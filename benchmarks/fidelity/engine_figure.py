"""Draws the results of benchmarks/fidelity/engine.py."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from engine_choices import CHOICES
from engine_deviations import ITERATIONS, STEPS, TOLERANCE, WHEELS, Row
from matplotlib.axes import Axes

from evoros.analysis.drawing.style import write_png

FILE = Path(__file__).parents[2] / "docs" / "img" / "engine.png"
COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7")


def figure(rows: Sequence[Row], spent: dict[str, dict[str, float]]) -> None:
    """Draw the deviations against the step, and the time of a step by world and choice."""
    plt.rcParams.update({"font.size": 9, "axes.spines.top": False, "axes.spines.right": False})
    canvas, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.8), layout="constrained")
    _deviations(left, rows)
    lines = left.get_legend_handles_labels()
    canvas.legend(*lines, ncols=4, fontsize=7, loc="outside lower center", frameon=False)
    _times(right, spent)
    FILE.parent.mkdir(parents=True, exist_ok=True)
    write_png(canvas, FILE)


def _deviations(axes: Axes, rows: Sequence[Row]) -> None:
    for wheels, line in zip(WHEELS, ("-", ":"), strict=True):
        for iterations, colour in zip(ITERATIONS, COLOURS, strict=True):
            curve = [r for r in rows if (r.wheels, r.iterations) == (wheels, iterations)]
            axes.plot(
                [1e3 * row.step for row in curve],
                [max(0.01, *row.deviations) for row in curve],
                line,
                color=colour,
                marker="o",
                markersize=3,
                linewidth=1.2,
                label=f"{iterations} iterations, {wheels}s",
            )
    axes.axhline(TOLERANCE, color="0.5", linewidth=0.8)
    axes.text(2.3, 0.92 * TOLERANCE, "2 %", color="0.4", va="top", fontsize=8)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xticks([1e3 * step for step in STEPS], ["2.5", "5", "10", "20", "\n25", "50"])
    axes.minorticks_off()
    axes.set_xlabel("time step [ms]")
    axes.set_ylabel("maximum deviation [% of the distance]")


def _times(axes: Axes, spent: dict[str, dict[str, float]]) -> None:
    names = list(CHOICES)[::-1]
    for shift, (world, times) in enumerate(spent.items()):
        heights = np.arange(len(names)) + 0.26 * (1 - shift)
        axes.barh(heights, [times[n] for n in names], 0.24, color=COLOURS[shift], label=world)
    axes.set_yticks(range(len(names)), names, fontsize=8)
    axes.set_xlabel("processor time of a step [us]")
    axes.legend(frameon=False, fontsize=7, loc="upper right")
