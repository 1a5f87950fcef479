"""How archives fill with the missions of runs, in the colours of their treatments."""

from collections.abc import Sequence

import pandas as pd
from matplotlib.axes import Axes

from .style import assign_colours

QUARTILES = (0.25, 0.5, 0.75)


def draw_growth(
    axes: Axes, growth: pd.DataFrame, treatments: Sequence[str], pooled: bool, column: str
) -> None:
    """Draw a column over the missions: each run, or median and quartiles of each treatment.

    ``growth`` has the columns ``treatment``, ``run``, ``generation`` and ``missions``.
    """
    for treatment, colour in assign_colours(treatments).items():
        rows = growth[growth.treatment == treatment]
        if not pooled:
            for name in dict.fromkeys(rows.run):
                run = rows[rows.run == name]
                axes.plot(run.missions, run[column], color=colour, lw=0.9, marker=".", ms=3)
            continue
        by_generation = rows.groupby("generation")
        missions = by_generation.missions.median()
        low, middle, high = (by_generation[column].quantile(share) for share in QUARTILES)
        axes.fill_between(missions, low, high, color=colour, alpha=0.2, lw=0)
        axes.plot(missions, middle, color=colour, lw=1.2, marker=".", ms=3)
    axes.set_xlabel("missions of a run")
    axes.set_ylim(bottom=0)
    axes.set_xlim(left=0)
