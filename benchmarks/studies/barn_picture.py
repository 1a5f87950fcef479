"""Draws docs/img/barn.png: score against price in all searches, and the designs of one front."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd
from barn_tables import BUDGETS, Missions, student
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evoros.analysis.drawing import style
from evoros.analysis.drawing.gallery import draw_designs
from evoros.analysis.statistics.small_samples import mean_interval
from evoros.analysis.tables.designs import place_sensors
from evoros.analysis.tables.records import read_record

FIGURE = Path(__file__).parents[2] / "docs" / "img" / "barn.png"
COLUMNS = 5  # of designs
LARGEST = 0.5  # the score of a robot that is fast enough everywhere
LIDAR = 1600.0  # its price
TICKS = [0, 8, 24, 100, 200, 400, 600, 1600]


def draw_bands(axes: Axes, hand: Mapping[str, Missions]) -> None:
    """Draw the score of the hand-made robot and of the tuned one, with intervals over worlds."""
    styles = ((style.VERMILLION, "follow the gap"), (style.ORANGE, "follow the gap, tuned"))
    for missions, (color, label) in zip(hand.values(), styles, strict=True):
        score = mean_interval(missions["score"].to_numpy())
        axes.axhspan(score.low, score.high, color=color, alpha=0.2, lw=0)
        axes.axhline(score.value, color=color, lw=1.0, label=label)
    axes.axhline(LARGEST, color="0.6", lw=0.8, ls=":")


def draw_fronts(axes: Axes, first: pd.DataFrame, others: Sequence[pd.DataFrame]) -> None:
    """Draw the front of each search, and number the designs of the first."""
    label = "fronts of the other seeds"
    for front in others:
        axes.plot(
            front["price"], front["score"], "o-", color=style.SKY, ms=2.5, lw=0.6, label=label
        )
        label = "_"
    axes.plot(first["price"], first["score"], "o-", color=style.BLUE, ms=4, lw=0.8, label="seed 0")
    for number, place in enumerate(zip(first["price"], first["score"], strict=True), 1):
        axes.annotate(f"{number}", place, (-9, 3), textcoords="offset points")


def draw_means(axes: Axes, reached: Mapping[str, pd.DataFrame]) -> None:
    """Draw the mean over the seeds for each budget, and for the lidar, with intervals."""
    *budgets, lidar = reached
    labels = [f"mean over {len(reached[budgets[0]])} seeds, by budget"]
    labels += ["_"] * (len(budgets) - 1) + [lidar]
    for price, rows, label in zip((*BUDGETS, LIDAR), reached.values(), labels, strict=True):
        score, color = (
            student(rows["score"].to_numpy()),
            style.GREEN if label == lidar else style.BLACK,
        )
        axes.plot([price] * 2, [score.low, score.high], color=color, lw=1.2, zorder=3)
        axes.plot(price, score.value, "s", color=color, ms=4, ls="none", label=label, zorder=3)


def finish(axes: Axes) -> None:
    """Label the axes."""
    axes.set_xscale("symlog", linthresh=8.0, linscale=0.6)
    axes.set(xlabel="price of the sensors [EUR]", ylabel="BARN score, 300 public worlds")
    axes.set(ylim=(0.0, 0.53), xlim=(-1.0, 2200.0))
    axes.set_xticks(TICKS, [f"{tick}" for tick in TICKS])
    axes.minorticks_off()
    axes.legend(loc="lower right", frameon=False)


def draw(
    run: Path,
    scored: Path,
    fronts: Sequence[pd.DataFrame],
    reached: Mapping[str, pd.DataFrame],
    hand: Mapping[str, Missions],
) -> None:
    """Draw the picture; the run and its scored front are those of the first search."""
    record, mounts = read_record(run, "run"), pd.read_csv(scored / "design.csv")
    placed = [place_sensors(rows, record.context) for _, rows in mounts.groupby("design")]
    titles = [
        f"{number}: {len(sensors)} sensors, {price:g} EUR"
        for number, (sensors, price) in enumerate(zip(placed, fronts[0]["price"], strict=True), 1)
    ]
    rows = -(-len(placed) // COLUMNS)
    with style.use_style():
        figure = Figure((style.PAGE_IN, 3.0 + 1.5 * rows), layout="constrained")
        grid = figure.add_gridspec(1 + rows, COLUMNS, height_ratios=[3.0] + [1.5] * rows)
        axes = figure.add_subplot(grid[0, :])
        draw_bands(axes, hand)
        draw_fronts(axes, fronts[0], fronts[1:])
        draw_means(axes, reached)
        finish(axes)
        panels = [
            figure.add_subplot(grid[1 + i // COLUMNS, i % COLUMNS]) for i in range(len(placed))
        ]
        draw_designs(panels, titles, placed, record.context)
        style.save(figure, FIGURE, "png")
