"""Draws docs/img/barn.png: score against price in all searches, and the designs of one front.

The arguments are folders: the run of seed 0, the evaluations of the hand-made robot and of the
tuned one, the scored runs, and the scored runs with the lidar (barn_seeds.py):

    python benchmarks/studies/barn_picture.py RUN GAP TUNED SCORED LIDAR
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from barn import read_missions
from barn_seeds import BUDGETS, Reached, list_reached, read_seeds, student
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evoros.analysis.drawing.gallery import draw_designs
from evoros.analysis.drawing.style import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    PAGE_IN,
    SKY,
    VERMILLION,
    save,
    use_style,
)
from evoros.analysis.statistics.small_samples import mean_interval
from evoros.analysis.tables.designs import place_sensors
from evoros.analysis.tables.records import read_record

FIGURE = Path(__file__).parents[2] / "docs" / "img" / "barn.png"
COLUMNS = 5  # of designs
LARGEST = 0.5  # the score of a robot that is fast enough everywhere
LIDAR = 1600.0  # its price
SHOWN = "0"  # the seed whose designs are drawn


def draw_bands(axes: Axes, gap: Path, tuned: Path) -> None:
    """Draw the score of the hand-made robot and of the tuned one, with intervals over worlds."""
    styles = ((gap, VERMILLION, "follow the gap"), (tuned, ORANGE, "follow the gap, tuned"))
    for folder, color, label in styles:
        score = mean_interval(read_missions(folder)["score"].to_numpy())
        axes.axhspan(score.low, score.high, color=color, alpha=0.2, lw=0)
        axes.axhline(score.value, color=color, lw=1.0, label=label)
    axes.axhline(LARGEST, color="0.6", lw=0.8, ls=":")


def draw_fronts(axes: Axes, fronts: dict[str, pd.DataFrame]) -> None:
    """Draw the front of each search, and number the designs of one."""
    label = "fronts of the other seeds"
    for seed, front in fronts.items():
        if seed != SHOWN:
            axes.plot(front["price"], front["score"], "o-", color=SKY, ms=2.5, lw=0.6, label=label)
            label = "_"
    front = fronts[SHOWN]
    axes.plot(front["price"], front["score"], "o-", color=BLUE, ms=4, lw=0.8, label=f"seed {SHOWN}")
    for number, (price, score) in enumerate(zip(front["price"], front["score"], strict=True), 1):
        axes.annotate(f"{number}", (price, score), (-9, 3), textcoords="offset points")


def draw_means(axes: Axes, reached: Sequence[Reached]) -> None:
    """Draw the mean over the seeds for each budget, and for the lidar, with intervals."""
    labels = [f"mean over {len(reached[0].rows)} seeds, by budget", *["_"] * (len(BUDGETS) - 1)]
    labels.append("network, the challenge's lidar")
    colors = [*[BLACK] * len(BUDGETS), GREEN]
    styles = zip((*BUDGETS, LIDAR), reached, labels, colors, strict=True)
    for price, one, label, color in styles:
        score = student(one.scores)
        axes.plot([price] * 2, [score.low, score.high], color=color, lw=1.2, zorder=3)
        axes.plot(price, score.value, "s", color=color, ms=4, ls="none", label=label, zorder=3)


def finish(axes: Axes) -> None:
    """Label the axes."""
    axes.set_xscale("symlog", linthresh=8.0, linscale=0.6)
    axes.set(xlabel="price of the sensors [EUR]", ylabel="BARN score, 300 public worlds")
    axes.set(ylim=(0.0, 0.53), xlim=(-1.0, 2200.0))
    ticks = [0, 8, 24, 100, 200, 400, 600, 1600]
    axes.set_xticks(ticks, [f"{tick}" for tick in ticks])
    axes.minorticks_off()
    axes.legend(loc="lower right", frameon=False)


def main(run: str, gap: str, tuned: str, scored: str, lidar: str) -> None:
    """Draw the picture of these folders."""
    record = read_record(Path(run), "run")
    fronts = read_seeds(Path(scored))
    mounts = pd.read_csv(Path(scored) / SHOWN / "public" / "design.csv")
    ids = list(dict.fromkeys(mounts["design"]))
    placed = [place_sensors(mounts[mounts["design"] == one], record.context) for one in ids]
    titles = [
        f"{number}: {len(sensors)} sensors, {price:g} EUR"
        for number, (sensors, price) in enumerate(
            zip(placed, fronts[SHOWN]["price"], strict=True), 1
        )
    ]
    rows = -(-len(ids) // COLUMNS)
    with use_style():
        figure = Figure((PAGE_IN, 3.0 + 1.5 * rows), layout="constrained")
        grid = figure.add_gridspec(1 + rows, COLUMNS, height_ratios=[3.0] + [1.5] * rows)
        axes = figure.add_subplot(grid[0, :])
        draw_bands(axes, Path(gap), Path(tuned))
        draw_fronts(axes, fronts)
        draw_means(
            axes, list_reached(list(fronts.values()), list(read_seeds(Path(lidar)).values()))
        )
        finish(axes)
        panels = [figure.add_subplot(grid[1 + i // COLUMNS, i % COLUMNS]) for i in range(len(ids))]
        draw_designs(panels, titles, placed, record.context)
        save(figure, FIGURE, "png")
    print(FIGURE)


if __name__ == "__main__":
    main(*sys.argv[1:])
