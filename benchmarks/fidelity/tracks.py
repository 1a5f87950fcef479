"""Draws the results of benchmarks/fidelity/manoeuvres.py."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from openloop import PERIOD, distances

from evoros.analysis.drawing.style import write_png
from evoros.base.arrays import Array, X, Y

LOOKS: Mapping[str, dict[str, object]] = {
    "PyBullet, 2.5 ms": {"color": "0.75", "linewidth": 3.5},
    "PyBullet, 25 ms": {"color": "#0072b2", "linewidth": 1.2},
    "MuJoCo, 10 ms": {"color": "#009e73", "linewidth": 1.2, "linestyle": (0, (1, 1))},
    "planar": {"color": "#d55e00", "linewidth": 1.2, "linestyle": (0, (4, 2))},
}
SHOWN = ("turn, full lock", "weave", "lock to lock, 1 s")
COMPARED = ("weave", "step to 0.4 rad", "lock to lock, 1 s")
HUES = ("#e69f00", "#56b4e9", "#cc79a7")


def figure(
    tracks: Mapping[str, Mapping[str, Array]],
    headings: Array,
    turns: Mapping[str, Array],
    file: Path,
) -> None:
    """Draw tracks, their distances, and turns (headings,) [deg] in 2 s."""
    style: dict[Any, Any] = {"font.size": 8, "axes.spines.top": False, "axes.spines.right": False}
    with mpl.rc_context(style):
        canvas = Figure(figsize=(7.2, 4.8), layout="constrained")
        parts: Any = canvas.subfigures(2, 1)
        upper, lower = parts
        for axes, name in zip(upper.subplots(1, len(SHOWN)), SHOWN, strict=True):
            _tracks(axes, name, tracks[name])
        left, right = lower.subplots(1, 2)
        _distances(left, tracks)
        _turns(right, headings, turns)
        handles, labels = upper.axes[0].get_legend_handles_labels()
        canvas.legend(handles, labels, ncols=4, loc="outside upper center", frameon=False)
        file.parent.mkdir(parents=True, exist_ok=True)
        write_png(canvas, file)


def _tracks(axes: Axes, name: str, tracks: Mapping[str, Array]) -> None:
    for simulator, track in tracks.items():
        axes.plot(track[:, X], track[:, Y], label=simulator, **LOOKS[simulator])  # type: ignore[arg-type]
    axes.set_title(name, loc="left", fontsize=8)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


def _distances(axes: Axes, tracks: Mapping[str, Mapping[str, Array]]) -> None:
    for name, colour in zip(COMPARED, HUES, strict=True):
        reference, coarse, mujoco, plane = tracks[name].values()
        time = PERIOD * np.arange(len(reference))
        axes.plot(time, 1e3 * distances(plane, reference), color=colour, label=name)
        axes.plot(time, 1e3 * distances(mujoco, reference), "--", color=colour)
        axes.plot(time, 1e3 * distances(coarse, reference), ":", color=colour)
    title = "solid: planar; dashed: MuJoCo; dotted: PyBullet, 25 ms"
    axes.set_title(title, loc="left", fontsize=8)
    axes.set_yscale("symlog", linthresh=10)
    axes.set_yticks([0, 5, 10, 50, 100, 500], ["0", "5", "10", "50", "100", "500"])
    axes.set_ylim(0, 2000)
    axes.set_xlim(0, 20)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("from PyBullet, 2.5 ms [mm]")
    axes.legend(fontsize=7, frameon=False, loc="upper left")


def _turns(axes: Axes, headings: Array, turns: Mapping[str, Array]) -> None:
    for simulator, angles in turns.items():
        look = LOOKS.get(simulator, {"color": "0.4", "linewidth": 1.0, "linestyle": ":"})
        label = None if simulator in LOOKS else simulator
        axes.plot(headings, angles, label=label, **look)  # type: ignore[arg-type]
    axes.axhline(0.0, color="0.5", linewidth=0.6)
    axes.set_xlim(0, 180)
    axes.set_xticks(range(0, 181, 45))
    axes.set_xlabel("heading at the start [deg]")
    axes.set_ylabel("turn in 2 s [deg]")
    axes.set_ylim(-1.3, 1.0)
    axes.set_title("lock to lock, 1 s", loc="left", fontsize=8)
    axes.legend(fontsize=7, frameon=False, loc="lower center")
