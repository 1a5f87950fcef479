"""Draws the results of benchmarks/fidelity/agreement.py."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from reliability import spearman

from evoros.base.arrays import Array

FILE = Path(__file__).parents[2] / "docs" / "img" / "agreement.png"
COLOURS = ("#0072b2", "#d55e00", "#009e73")


def figure(means: Sequence[tuple[str, Array, Array]]) -> None:
    """Draw the planar fitness (designs, trials) against PyBullet's, a panel for each treatment."""
    style: dict[Any, Any] = {"font.size": 8, "axes.spines.top": False, "axes.spines.right": False}
    with mpl.rc_context(style):
        canvas = Figure(figsize=(7.2, 2.7), layout="constrained")
        panels = canvas.subplots(1, len(means), sharex=True, sharey=True, squeeze=False)[0]
        for axes, colour, (treatment, real, plane) in zip(panels, COLOURS, means, strict=False):
            axes.plot((3, 24), (3, 24), color="0.75", linewidth=0.8, zorder=0)
            axes.errorbar(
                real.mean(axis=1),
                plane.mean(axis=1),
                xerr=_error(real),
                yerr=_error(plane),
                fmt="o",
                markersize=3,
                linewidth=0.5,
                color=colour,
                ecolor="0.8",
                zorder=1,
            )
            rank = spearman(real.mean(axis=1), plane.mean(axis=1))
            trials = f"{real.shape[1]} trial" + "s" * (real.shape[1] > 1)
            axes.set_title(f"failure: {treatment}", loc="left", fontsize=8)
            axes.text(
                0.04, 0.94, f"rank correlation {rank:.2f}", transform=axes.transAxes, va="top"
            )
            axes.text(
                0.96, 0.04, f"{len(real)} designs, {trials}", transform=axes.transAxes, ha="right"
            )
            axes.set_xlabel("fitness in PyBullet")
            axes.set_aspect("equal")
            axes.set(xlim=(2.5, 19), ylim=(2.5, 19), xticks=(5, 10, 15), yticks=(5, 10, 15))
        panels[0].set_ylabel("fitness in planar, same draws")
        FILE.parent.mkdir(parents=True, exist_ok=True)
        canvas.savefig(FILE, dpi=300)


def _error(fitness: Array) -> Array | None:
    """Standard error of the mean over the trials."""
    trials = fitness.shape[1]
    return fitness.std(axis=1, ddof=1) / np.sqrt(trials) if trials > 1 else None
