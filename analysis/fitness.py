"""Fitness over the generations: every individual, the best and the mean (the paper's Fig. 9)."""

import matplotlib as mpl
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from .style import COLUMN_IN, STYLE  # relative: installed, this is evoros.analysis


def fitness(generations: pd.DataFrame, width: float = COLUMN_IN) -> Figure:
    """A point an individual, the best and the mean of each generation, and the validated best.

    ``generations`` has the columns of a run's generation tables; ``width`` is in inches.
    Individuals that a generation only kept are drawn in each generation in which they stand.
    """
    per = generations.groupby("generation")
    validated = generations.loc[per.fitness.idxmax()].set_index("generation").validated_fitness
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(width, 0.72 * width), layout="constrained")
        axes = figure.subplots()
        axes.scatter(
            generations.generation,
            generations.fitness,
            s=5,
            c=generations.generation,
            cmap="viridis",
            alpha=0.6,
            linewidths=0,
        )
        axes.plot(per.fitness.max(), color="black", lw=1.2, label="best, recorded")
        axes.plot(per.fitness.mean(), color="black", lw=1.0, ls="--", label="mean")
        if validated.notna().any():
            axes.plot(validated, color="#d55e00", lw=1.2, label="best, validated")
        axes.set_xlabel("generation")
        axes.set_ylabel("fitness (Eq. 1)")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.spines[["top", "right"]].set_visible(False)
        figure.legend(loc="outside lower center", ncols=3, frameon=False, handlelength=1.5)
    return figure
