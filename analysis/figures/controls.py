"""Champions and controls on the same draws: no sensors, random search, hand-made designs."""

import argparse
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.certificate.controls import NO_SENSORS, RANDOM
from evoros.storage.layout import CONTROLS, EVALUATION

from ..drawing.style import BLUE, VERMILLION, cut_short, figure_width, is_wide, use_style, wrap
from ..statistics.regression import ALL_WORLDS, compare_missions
from ..statistics.small_samples import mean_interval
from ..subcommands import Product
from ..tables.pairs import CHAMPION, COMPLETED, QUANTITIES, read_missions
from ..tables.records import Record, label_fitness, read_record
from ..tables.study import Study

HELP = "each champion against no sensors, random search and hand-made designs"
NEEDS = "runs with controls"
FILES = ("controls.csv", "controls_summary.csv")
LOOKS = {"control": (VERMILLION, 7.0, "white"), "champion": (BLUE, 4.0, BLUE)}
"""Edge colour, size and face colour of markers for controls and champions."""
INTERVAL = "95 % confidence interval for the difference"
ROW_IN, HEAD_IN = 0.24, 1.1
NAME_LENGTH = 28
TITLES = {NO_SENSORS: "no sensors", RANDOM: "random search"}
DECIDES = {NO_SENSORS: "the sensors", RANDOM: "the search"}  # advantage of the champion
LITTLE = 0.9  # completion rate relative to the champion's above which a control decides little
SHARES = ("control_completed", "champion_completed")
FITNESS = ("control_fitness", "champion_fitness")
CHANGE = ("difference", "low", "high")


def make_product(study: Study, options: argparse.Namespace) -> Product:
    """Draw the means of champions and controls, with small dots for single runs."""
    table = compare_controls(study)
    summary = summarize_controls(table)
    label = label_fitness(study.records)
    figure = _draw_controls(table, summary, figure_width(options.columns, 2), label)
    messages = describe_controls(summary, label)
    return Product(table, figure, messages, {"controls_summary.csv": summary})


def _draw_controls(
    table: pd.DataFrame, summary: pd.DataFrame, width: float, label: str = "fitness"
) -> Figure:
    several = summary["treatment"].nunique() > 1
    keys = list(zip(summary["treatment"], summary["control"], strict=True))
    names = [
        cut_short((f"{treatment}: " if several else "") + TITLES.get(name, name), NAME_LENGTH)
        for treatment, name in keys
    ]
    room = 30 if is_wide(width) else 12  # characters in a line below an axis
    with use_style():
        size = (width, HEAD_IN + ROW_IN * len(keys))
        figure = Figure(figsize=size, layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True)
        for axes, columns, scale in ((left, SHARES, 100.0), (right, FITNESS, 1.0)):
            for height, key in enumerate(keys):
                runs = table[(table["treatment"] == key[0]) & (table["control"] == key[1])]
                _draw_row(axes, scale * runs[list(columns)].to_numpy(float), height)
        ends = (summary["champion_completed"] - summary[name] for name in ("high", "low"))
        bars: dict[str, Any] = {"color": VERMILLION, "lw": 1.0, "capsize": 2.5, "zorder": 2}
        bars |= {"fmt": "none", "label": INTERVAL}
        spans = np.clip([100 * end.to_numpy(float) for end in ends], 0.0, 100.0)
        rows = range(len(keys))
        left.errorbar(spans.mean(axis=0), rows, xerr=np.ptp(spans, axis=0) / 2, **bars)
        left.set(xlabel=wrap("completed missions [%]", room), xlim=(-4, 104))
        left.set_yticks(rows, names)
        left.set_ylim(len(keys) - 0.5, -0.5)
        right.set(xlabel=wrap(label, room))
        handles, titles = left.get_legend_handles_labels()
        across = 3 if is_wide(width) else 2
        figure.legend(handles, titles, loc="outside upper center", ncols=across, frameon=False)
    return figure


def _draw_row(axes: Axes, values: Array, y: int) -> None:
    means = values.mean(axis=0)
    axes.plot(means, [y, y], color="0.7", lw=1.5, zorder=1)
    for side, (name, (edge, size, face)) in enumerate(LOOKS.items()):
        if len(values) > 1:
            heights = y + 0.25 * np.linspace(-1, 1, len(values))
            axes.scatter(values[:, side], heights, s=3, color=edge, alpha=0.5, lw=0, zorder=2)
        known = axes.get_legend_handles_labels()[1]
        look: dict[str, Any] = {"marker": "o", "ms": size, "mec": edge, "mfc": face, "lw": 0}
        axes.plot(means[side], y, **look, zorder=3, label=None if name in known else name)


def compare_controls(study: Study) -> pd.DataFrame:
    """Compare the champion of each finished run with its controls: one row per run and control.

    ``difference`` is the champion's minus the control's completion rate on the same draws.
    """
    recorded = [record for record in study.records if (record.path / CONTROLS).is_dir()]
    if not recorded:
        raise InputError(
            "controls: no run has been compared with a control; type: evoros resume RUN "
            "controls=all"
        )
    return study.keep(recorded).gather(_compare)


def _compare(record: Record) -> pd.DataFrame:
    evaluation = read_record(record.path / CONTROLS / EVALUATION, record.name)
    evaluation.require_finished()
    missions = read_missions(evaluation)
    missions["design"] = _name(missions)
    is_champion = missions["design"] == CHAMPION
    columns = ["world", "trial", *QUANTITIES]
    pairs = missions[~is_champion].merge(
        missions.loc[is_champion, columns], on=["world", "trial"], suffixes=("_a", "_b")
    )
    tests = compare_missions(pairs, [COMPLETED])
    tests = tests[tests["world"] == ALL_WORLDS].set_index("design")
    scores = evaluation.run.designs
    scores = scores.assign(fitness=scores.get("fitness", scores["fitness_mean"]))
    fitness = dict(zip(_name(scores), scores["fitness"], strict=True))
    order = [name for name in fitness if name != CHAMPION]
    tests = tests.loc[order]
    return pd.DataFrame(
        {
            "control": order,
            "missions": tests["missions"].to_numpy(),
            "control_completed": tests["mean_a"].to_numpy(),
            "champion_completed": tests["mean_b"].to_numpy(),
            **{name: tests[name].to_numpy() for name in CHANGE},
            "control_fitness": [fitness[name] for name in order],
            "champion_fitness": fitness[CHAMPION],
        }
    )


def _name(table: pd.DataFrame) -> "pd.Series[str]":
    source, design = table["source"], table["design"].astype(str)
    return source.where(source.isin([CHAMPION, *TITLES]), source + " " + design)


def summarize_controls(table: pd.DataFrame) -> pd.DataFrame:
    """Average over the runs of each treatment; with several runs, intervals are over the runs."""
    rows = []
    for (treatment, control), runs in table.groupby(["treatment", "control"], sort=False):
        means = runs[[*SHARES, *FITNESS, *CHANGE]].mean().to_dict()
        if len(runs) > 1:
            change = mean_interval(runs["difference"].to_numpy(float))
            means |= {"low": change.low, "high": change.high}
        rows.append({"treatment": treatment, "control": control, "runs": len(runs), **means})
    return pd.DataFrame(rows)


def describe_controls(summary: pd.DataFrame, label: str) -> list[str]:
    """Return a sentence for each row of ``summarize_controls``; ``label`` names the fitness."""
    several = summary["treatment"].nunique() > 1
    rows = summary.to_dict("records")
    return [
        f"{row['treatment']}, control " * several + _describe_control(row, label) for row in rows
    ]


def _describe_control(row: Mapping[Any, Any], label: str) -> str:
    control, champion = (100 * float(row[name]) for name in SHARES)
    low, high = (100 * row[name] for name in ("low", "high"))
    text = (
        f"{TITLES.get(row['control'], row['control'])}: completes {control:.0f} %, the champion "
        f"{champion:.0f} % (95 % confidence interval for the difference {low:.0f} to {high:.0f} "
        "points); "
        f"{label} {row['control_fitness']:.3g}, the champion's {row['champion_fitness']:.3g}"
    )
    if not champion:
        return f"{text}; the champion completes none, so the comparison is inconclusive"
    if control == champion and row["control_fitness"] == row["champion_fitness"]:
        return f"{text}; the scores are equal, so the control is probably the champion itself"
    if high < 0:
        return f"{text}; the control is better"
    if high <= (1 - LITTLE) * champion:
        return f"{text}; {DECIDES.get(row['control'], 'the search')} made little difference here"
    return text if low > 0 else f"{text}; no evidence that the champion is better"
