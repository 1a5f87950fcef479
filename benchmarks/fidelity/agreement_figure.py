"""Draws the results of benchmarks/fidelity/agreement.py."""

from collections.abc import Mapping, Sequence
from itertools import combinations, cycle
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from reliability import spearman

from evoros.analysis.drawing.style import write_png
from evoros.base.arrays import Array

FOLDER = Path(__file__).parents[2] / "docs" / "img"
COLOURS = ("#0072b2", "#d55e00", "#009e73")


NAMES = {"pybullet": "PyBullet", "mujoco": "MuJoCo", "gazebo": "Gazebo", "planar": "planar"}
STYLE: dict[Any, Any] = {"font.size": 8, "axes.spines.top": False, "axes.spines.right": False}


def figure(means: Mapping[str, Sequence[tuple[str, Array, Array]]]) -> None:
    """Draw the planar fitness (designs, trials) against each engine's, a panel for each treatment.

    ``means`` has the treatment and the fitness in the engine and in planar, by engine.
    """
    columns = max(map(len, means.values()))
    with mpl.rc_context(STYLE):
        canvas = Figure(figsize=(2.4 * max(columns, 2), 2.7 * len(means)), layout="constrained")
        panels = canvas.subplots(len(means), columns, sharex=True, sharey=True, squeeze=False)
        for row, (engine, treatments) in zip(panels, means.items(), strict=True):
            for axes, colour, (treatment, real, plane) in zip(
                row, COLOURS, treatments, strict=False
            ):
                _panel(axes, colour, real, plane)
                axes.set_title(f"failure: {treatment}", loc="left", fontsize=8)
                axes.set_xlabel(f"fitness in {NAMES[engine]}")
            row[0].set_ylabel("fitness in planar, same draws")
            for axes in row[len(treatments) :]:
                axes.set_axis_off()
        write_png(canvas, FOLDER / "agreement.png", dpi=160)


def figure_of_pairs(fitness: Mapping[str, Array]) -> None:
    """Draw the fitness (designs, trials) in each two of the simulators."""
    pairs = list(combinations(fitness, 2))
    with mpl.rc_context(STYLE):
        canvas = Figure(figsize=(7.2, 2.7 * len(pairs) / 3), layout="constrained")
        panels = canvas.subplots(len(pairs) // 3, 3, sharex=True, sharey=True)
        for axes, colour, (first, second) in zip(panels.flat, cycle(COLOURS), pairs, strict=False):
            _panel(axes, colour, fitness[first], fitness[second])
            axes.set_xlabel(f"fitness in {NAMES[first]}")
            axes.set_ylabel(f"fitness in {NAMES[second]}")
        write_png(canvas, FOLDER / "agreement_engines.png", dpi=160)


def _panel(axes: Axes, colour: str, first: Array, second: Array) -> None:
    axes.plot((3, 24), (3, 24), color="0.75", linewidth=0.8, zorder=0)
    axes.errorbar(
        first.mean(axis=1),
        second.mean(axis=1),
        xerr=_error(first),
        yerr=_error(second),
        fmt="o",
        markersize=3,
        linewidth=0.5,
        color=colour,
        ecolor="0.8",
        zorder=1,
    )
    rank = spearman(first.mean(axis=1), second.mean(axis=1))
    trials = f"{first.shape[1]} trial" + "s" * (first.shape[1] > 1)
    axes.text(0.04, 0.94, f"rank correlation {rank:.2f}", transform=axes.transAxes, va="top")
    label = f"{len(first)} designs, {trials}"
    axes.text(0.96, 0.04, label, transform=axes.transAxes, ha="right")
    axes.set_aspect("equal")
    axes.set(xlim=(2.5, 19), ylim=(2.5, 19), xticks=(5, 10, 15), yticks=(5, 10, 15))


def _error(fitness: Array) -> Array | None:
    """Standard error of the mean over the trials."""
    trials = fitness.shape[1]
    return fitness.std(axis=1, ddof=1) / np.sqrt(trials) if trials > 1 else None
