"""Draws docs/img/barn.png: score against price, and the designs of the front.

The arguments are folders: the run, the evaluations of the hand-made robot and of the front, and the
front's designs:

    python benchmarks/studies/barn_picture.py RUN GAP SCORED DESIGNS
"""

import sys
from pathlib import Path

import pandas as pd
from barn import read_missions
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evoros.analysis.drawing.gallery import draw_designs
from evoros.analysis.drawing.style import BLUE, PAGE_IN, VERMILLION, save, use_style
from evoros.analysis.statistics.small_samples import Interval, mean_interval
from evoros.analysis.tables.designs import place_sensors
from evoros.analysis.tables.records import read_record

FIGURE = Path(__file__).parents[2] / "docs" / "img" / "barn.png"
COLUMNS = 5  # of designs
LARGEST = 0.5  # the score of a robot that is fast enough everywhere


def measure_designs(missions: pd.DataFrame) -> dict[str, tuple[float, Interval]]:
    """Return the price of each design, and its mean score with the interval."""
    return {
        str(name): (float(rows["price"].iloc[0]), mean_interval(rows["score"].to_numpy()))
        for name, rows in missions.groupby("design", sort=False)
    }


def draw_scores(axes: Axes, hand: Interval, front: dict[str, tuple[float, Interval]]) -> None:
    """Draw the score of each design of the front, numbered, and the band of the hand-made one."""
    axes.axhspan(hand.low, hand.high, color=VERMILLION, alpha=0.2, lw=0)
    axes.axhline(hand.value, color=VERMILLION, lw=1.0, label="follow the gap, lidar of 1600")
    axes.axhline(LARGEST, color="0.6", lw=0.8, ls=":")
    label = "evolved"
    for number, (price, score) in enumerate(front.values(), 1):
        axes.plot([price] * 2, [score.low, score.high], color=BLUE, lw=1.0)
        axes.plot(price, score.value, "o", color=BLUE, ms=4, ls="none", label=label)
        axes.annotate(f"{number}", (price, score.value), (4, 3), textcoords="offset points")
        label = "_"
    axes.set_xscale("symlog", linthresh=8.0)
    axes.set(xlabel="price of the sensors [EUR]", ylabel="BARN score, 300 public worlds")
    axes.set(ylim=(0.0, 0.53), xlim=(-1.0, 800.0))
    ticks = [0, 8, 16, 32, 64, 128, 256, 512]
    axes.set_xticks(ticks, [f"{tick}" for tick in ticks])
    axes.minorticks_off()
    axes.legend(loc="lower right", frameon=False)


def main(run: str, gap: str, scored: str, designs: str) -> None:
    """Draw the picture of these folders."""
    record = read_record(Path(run), "run")
    (_, hand), *_ = measure_designs(read_missions(Path(gap))).values()
    front = measure_designs(read_missions(Path(scored)))
    mounts = pd.read_csv(Path(designs) / "design.csv")
    ids = list(dict.fromkeys(mounts["design"]))
    placed = [place_sensors(mounts[mounts["design"] == one], record.context) for one in ids]
    titles = [
        f"{number}: {len(sensors)} sensors, {price:g} EUR"
        for number, (sensors, (price, _)) in enumerate(zip(placed, front.values(), strict=True), 1)
    ]
    rows = -(-len(ids) // COLUMNS)
    with use_style():
        figure = Figure((PAGE_IN, 2.6 + 1.5 * rows), layout="constrained")
        grid = figure.add_gridspec(1 + rows, COLUMNS, height_ratios=[2.6] + [1.5] * rows)
        draw_scores(figure.add_subplot(grid[0, :]), hand, front)
        panels = [figure.add_subplot(grid[1 + i // COLUMNS, i % COLUMNS]) for i in range(len(ids))]
        draw_designs(panels, titles, placed, record.context)
        save(figure, FIGURE, "png")
    print(FIGURE)


if __name__ == "__main__":
    main(*sys.argv[1:])
