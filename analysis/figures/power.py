"""The number of replicates required for a given power of the test of ``compare``."""

import argparse
from collections.abc import Hashable, Mapping, Sequence
from math import comb, inf, isinf
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from evoros.base.errors import InputError

from ..drawing.style import CATEGORIES, COLUMN_IN, figure_width, use_style, wrap
from ..statistics.comparison import group_values, title_measure
from ..statistics.power import (
    MAX_REPLICATES,
    MIN_SCATTER,
    Simulation,
    measure_scatter,
    plan_replicates,
)
from ..statistics.small_samples import LEVEL, describe_shortfalls
from ..statistics.two_samples import TEST
from ..subcommands import Product
from ..tables.records import FITNESS, label_fitness
from ..tables.study import Study
from .options import add_conditions, score_runs

HELP = "number of replicates needed to detect a given difference, simulated from these runs"
NEEDS = "finished runs with replicates"
FILES = ("power.csv", "power_curves.csv")
USUAL = (0.5, 1.0, 1.5)  # default differences, in standard deviations
BAR_STEP = 0.03  # vertical distance between the bars of two differences, in units of power
TITLE_LENGTH = 36  # maximum number of characters per line of the legend title
POINTS = 14  # number of computed points per curve


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options for difference, power, comparisons and fitness."""
    about = (
        "difference in fitness between two treatments; may be repeated; default: 0.5, 1 and "
        "1.5 standard deviations of the replicates"
    )
    parser.add_argument("--difference", type=float, action="append", metavar="D", help=about)
    about = "probability of detecting the difference; default: 0.8"
    parser.add_argument("--power", type=float, default=0.8, metavar="P", help=about)
    about = "number of pairs of treatments to compare; default: all pairs in the given runs"
    parser.add_argument("--comparisons", type=int, metavar="K", help=about)
    about = "use the recorded fitness, not the validated fitness"
    parser.add_argument("--recorded", action="store_true", help=about)
    add_conditions(parser)


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Plot power over replicates; tables list the required numbers and the curves."""
    _check(options)
    runs, measures = score_runs(study, options.under)
    label = label_fitness(study.records)
    measure = measures[0] if options.recorded or options.under else measures[-1]
    groups = list(group_values(runs, measure).values())
    scatter = measure_scatter(groups)
    if scatter is None:
        raise InputError(
            f"{title_measure(measure, label)}: too few replicates, or all values are equal; "
            f"run at least {MIN_SCATTER} seeds of one treatment to estimate power"
        )
    comparisons = options.comparisons or max(1, comb(len(groups), 2))
    simulation = Simulation(scatter, comparisons)
    deviation = scatter.deviation
    differences = options.difference or [share * deviation.value for share in USUAL]
    plans = list(plan_replicates(simulation, differences, options.power))
    about = {"measure": measure, "power": options.power, "comparisons": comparisons}
    about |= {"runs": scatter.residuals.size, "sd": deviation.value}
    about |= {"sd_low": deviation.low, "sd_high": deviation.high}
    table = pd.DataFrame([{**about, **plan} for plan in plans])
    curves = _trace(simulation, plans)
    title = title_measure(measure, label)
    figure = draw_power(curves, plans, options.power, figure_width(options.columns), title)
    messages = [_conclude(row, title) for row in table.to_dict("records")]
    messages += describe_shortfalls("standard deviation")
    shown = table.replace(inf, np.nan)
    return Product(shown, figure, messages, {"power_curves.csv": curves})


def _check(options: argparse.Namespace) -> None:
    comparisons = [] if options.comparisons is None else [options.comparisons]
    rules: dict[str, tuple[Sequence[float], float, float]] = {
        "--difference": (options.difference or [], 1e-9, 1e9),
        "--power": ([options.power], 0.1, 0.99),
        "--comparisons": (comparisons, 1, 1000),
    }
    for name, (values, low, high) in rules.items():
        for value in values:
            if not low <= value <= high:
                raise InputError(
                    f"{name}: must be a number from {low:g} to {high:g}, not {value:g}"
                )


def _trace(simulation: Simulation, plans: Sequence[Mapping[str, float]]) -> pd.DataFrame:
    ends = [plan["replicates"] for plan in plans]
    longest = max((end for end in ends if not isinf(end)), default=MAX_REPLICATES)
    end = min(MAX_REPLICATES, max(10, int(1.5 * longest)))
    numbers = np.unique(np.geomspace(2, end, POINTS).round().astype(int))
    rows = [
        (plan["difference"], plan["in_sd"], n, simulation.compute_power(plan["in_sd"], int(n)))
        for plan in plans
        for n in numbers
    ]
    return pd.DataFrame(rows, columns=["difference", "in_sd", "replicates", "power"])


def _conclude(row: Mapping[Hashable, Any], title: str) -> str:
    pairs = row["comparisons"]
    adjusted = "one comparison" if pairs == 1 else f"Holm over {pairs} comparisons"
    deviations = f"{row['in_sd']:.2g} standard deviation" + "s" * (row["in_sd"] != 1)
    needed, low, high = (_format(row[f"replicates{end}"]) for end in ("", "_low", "_high"))
    return (
        f"{title}: {needed} replicates per treatment detect a difference of "
        f"{row['difference']:.3g} ({deviations}) at the {100 * LEVEL:.0f} % level with a "
        f"probability of {100 * row['power']:.0f} % ({TEST}, {adjusted}), if replicates scatter "
        f"like the {row['runs']} given runs; 95 % interval of this number, assuming normally "
        f"distributed values: {low} to {high}"
    )


def _format(replicates: float) -> str:
    return f"more than {MAX_REPLICATES}" if isinf(replicates) else f"{replicates:.0f}"


def draw_power(
    curves: pd.DataFrame,
    plans: Sequence[Mapping[str, float]],
    power: float,
    width: float = COLUMN_IN,
    title: str = FITNESS,
) -> Figure:
    """Plot power over replicates, with dots at the required numbers; ``width`` is in inches."""
    with use_style():
        figure = Figure(figsize=(width, 2.6), layout="constrained")
        axes = figure.subplots()
        axes.axhline(power, color="0.6", lw=0.8, ls=":")
        end = float(curves["replicates"].max())
        for i, plan in enumerate(plans):
            rows = curves[curves["difference"] == plan["difference"]]
            colour = CATEGORIES[i % len(CATEGORIES)]
            label = f"{plan['difference']:.3g} ({plan['in_sd']:.2g} SD)"
            axes.plot(rows["replicates"], rows["power"], color=colour, lw=1.2, label=label)
            low, high = (min(plan[f"replicates_{side}"], end) for side in ("low", "high"))
            y = power + BAR_STEP * ((len(plans) - 1) / 2 - i)  # keeps bars from overlapping
            axes.plot([low, high], [y, y], color=colour, lw=1.2)
            if plan["replicates_high"] > end:
                axes.plot(high, y, ">", color=colour, ms=4, clip_on=False)
            if plan["replicates"] <= end:
                axes.plot(plan["replicates"], power, "o", color=colour, ms=4.5)
        axes.set(xlabel="replicates per treatment", ylabel="probability of detection")
        axes.set(ylim=(0, 1.03), xlim=(0, end * 1.03))
        about = wrap(f"difference in {title} (bars: 95 % intervals)", TITLE_LENGTH)
        axes.legend(title=about, frameon=False, loc="lower right")
    return figure
