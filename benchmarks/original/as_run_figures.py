"""Draws the figures of benchmarks/original/as_run.py from the files in its folder."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from as_run_ranks import DESIGNS, correlation, place_name
from as_run_report import ORIGINAL, ROOT, TREATMENTS, WORLDS, curves, designs, read
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evoros.analysis.drawing.style import write_png

IMAGES = ROOT / "docs" / "img"
LOGS, RUNS, COUNTED = "black", "#0072b2", "#d55e00"
STYLE: dict[Any, Any] = {"font.size": 8, "axes.spines.top": False, "axes.spines.right": False}


def draw_designs(folder: Path) -> Figure:
    """Draw the distribution of fitness and the share that gets home in each world."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 2.7), layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=(1.3, 1))
        quantiles = ORIGINAL["none"]["quantiles"]
        left.plot(quantiles, np.linspace(0, 1, len(quantiles)), color=LOGS, label="the logs")
        missions = read(folder, "l1_none")
        for score, colour, dashes, label in (
            ("to_home", COUNTED, "--", "here, counted to home"),
            ("whole", RUNS, "-.", "here, whole missions"),
        ):
            values = np.sort(designs(missions, score))
            heights = np.arange(1, len(values) + 1) / len(values)
            left.plot(values, heights, color=colour, ls=dashes, label=label)
        left.set(xlabel="fitness (Eq. 1)", ylabel="share of random designs", ylim=(0, 1.02))
        left.legend(frameon=False, loc="lower right")
        _homes(right, folder)
    return figure


def _homes(axes: Axes, folder: Path) -> None:
    """Draw a group of points for each world, with points for each treatment."""
    places = {}
    for i, world in enumerate(WORLDS):
        axes.text(4 * i + 1, 1.02, world, ha="center")
        for j, treatment in enumerate(TREATMENTS):
            logs = ORIGINAL[treatment]["first"][world]["home"]
            here, late = (
                read(folder, f"{name}_{treatment}").groupby("world").home.mean()[world]
                for name in ("l1", "late")
            )
            places[4 * i + j] = treatment
            for value, colour, marker, label in (
                (logs, LOGS, "o", "the logs"),
                (here, RUNS, "s", "here"),
                (late, COUNTED, "^", "here, readings 1 s late"),
            ):
                label = label if i == j == 0 else "_"
                axes.plot(4 * i + j, value, marker, color=colour, ms=4, label=label)
    axes.set_xticks(list(places), list(places.values()), rotation=90)
    axes.set(ylabel="share that gets home", ylim=(0, 1))
    axes.legend(frameon=False, fontsize=7, loc="upper center", bbox_to_anchor=(0.45, 1.0))


def draw_runs(folder: Path) -> Figure:
    """Draw the best and the mean fitness of each generation, averaged over ten runs."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 2.6), layout="constrained")
        for axes, treatment in zip(
            figure.subplots(1, 3, sharex=True, sharey=True), TREATMENTS, strict=True
        ):
            logs = ORIGINAL[treatment]
            axes.plot(logs["best"], color=LOGS, label="the logs")
            axes.plot(logs["mean"], color=LOGS, ls=":")
            for name, colour, label in (
                ("logged", COUNTED, "here, counted as logged"),
                ("l1", RUNS, "here, whole missions"),
            ):
                per = curves(folder, name, treatment).groupby(["generation", "run"]).fitness
                axes.plot(per.max().unstack().mean(axis=1), color=colour, label=label)
                axes.plot(per.mean().unstack().mean(axis=1), color=colour, ls=":")
            axes.set(xlabel="generation", title=treatment)
        figure.axes[0].set(ylabel="fitness (Eq. 1)", ylim=(4, 20))
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure


def draw_ranks(folder: Path) -> Figure:
    """Draw the fitness of each logged design here against that in the logs, by turning point."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 2.9), layout="constrained")
        logs = pd.read_csv(DESIGNS).fitness
        panels = figure.subplots(1, 2, sharex=True, sharey=True)
        for axes, (place, title) in zip(
            panels,
            ((None, "turning about the rear axle"), (0.12, "turning about x = 0.12 m")),
            strict=True,
        ):
            missions = read(folder, f"rank_0_{place_name(place)}")
            here = len(WORLDS) * missions.groupby("design").to_home.mean()
            label = f"{title}: rank correlation {correlation(logs, here):.2f}"
            axes.plot(logs, here, "o", color=RUNS, ms=3, alpha=0.4, mew=0)
            axes.set_title(label, fontsize=8)
            axes.set(xlabel="fitness in the logs, mean of the times it was scored")
        panels[0].set(ylabel="fitness here, counted to home")
    return figure


def main(folder: Path) -> None:
    for name, draw in (
        ("original", draw_designs),
        ("original_runs", draw_runs),
        ("original_ranks", draw_ranks),
    ):
        write_png(draw(folder), IMAGES / f"{name}.png")
