"""The picture of a comparison: dots and boxes of each treatment, and the tests below them."""

import textwrap
from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import MaxNLocator

from evoros.base.arrays import Array

from ..measures.statistics import LEVEL, least_replicates, median_interval
from .columns import SMALL_PT, height_in, write
from .style import COLUMN_IN, STYLE, letter, treatment_colours

MEASURES = ("recorded", "validated")
MOST_TESTS = 30
"""That are written below the picture; where there are more, only the table has them."""
LONGEST = 10
"""Characters of a treatment that the tests call by its name; longer ones get letters."""
WRAPPED = 20
"""Characters of a line of a label."""
BOX, DOTS = (-0.22, 0.24), (0.18, 0.3)
"""Where boxes and dots lie in the row of a treatment: from its middle, and how wide."""
ROW_IN = 0.36
GOLDEN = 0.6180339887498949
HEADS = {
    "treatments": (0.0, "left"),
    "p": (0.53, "right"),
    "p (Holm)": (0.7, "right"),
    "A12": (0.8, "right"),
    "effect": (0.84, "left"),
}
"""The columns of the tests: where they are, of their width, and which side of them is there."""


def compare(runs: pd.DataFrame, table: pd.DataFrame, width: float = COLUMN_IN) -> Figure:
    """A panel a measure of fitness: a dot a run below a box of the quartiles, then the tests.

    ``table`` is of ``comparisons`` of ``runs``; ``width`` is in inches. Whiskers end at the last
    value within 1.5 times the box. Beside each box stand the median, its bootstrap interval and n.
    """
    letters = _letters(list(dict.fromkeys(runs["treatment"].astype(str))))
    measures = list(dict.fromkeys(table["measure"]))
    tests = {each: table[(table["measure"] == each) & (table["b"] != "")] for each in measures}
    written = {name: rows for name, rows in tests.items() if 0 < len(rows) <= MOST_TESTS}
    labels = _labels(letters)
    row_in = max(ROW_IN, *(0.11 * (label.count("\n") + 1.5) for label in labels))
    above = row_in * len(letters) + 0.45
    few = any(map(_too_few, written.values()))
    below = max((height_in(len(rows), few) for rows in written.values()), default=0.0)
    across = len(measures) if width > 1.5 * COLUMN_IN else 1
    down = len(measures) // across
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(width, (above + below) * down), layout="constrained")
        parts = figure.subfigures(down, across, squeeze=False).ravel()
        for part, measure in zip(parts, measures, strict=True):
            ratios = [above, below or 1e-6]
            top, bottom = part.subfigures(2, 1, squeeze=False, height_ratios=ratios).ravel()
            axes = top.subplots()
            axes.set_yticks(range(len(labels)), labels, fontsize=SMALL_PT)
            _panel(axes, runs, measure, list(letters))
            if measure in written:
                _write(bottom, written[measure], letters, (width / across, below))
    return figure


def called(measure: str) -> str:
    """``recorded fitness``, ``fitness under NAME``."""
    return f"{measure} fitness" if measure in MEASURES else f"fitness {measure}"


def p_text(p: float) -> str:
    """A p to three decimals."""
    return "p < 0.001" if p < 0.001 else f"p = {p:.3f}"


def _letters(names: list[str]) -> dict[str, str]:
    """What the tests call the treatments."""
    if max(map(len, names)) <= LONGEST:
        return {name: name for name in names}
    return {name: letter(i) for i, name in enumerate(names)}


def _labels(letters: Mapping[str, str]) -> list[str]:
    """What the rows of the panels are called."""
    full = [name if letter == name else f"{letter}: {name}" for name, letter in letters.items()]
    return ["\n".join(textwrap.wrap(each, WRAPPED)) for each in full]


def _panel(axes: Axes, runs: pd.DataFrame, measure: str, names: Sequence[str]) -> None:
    """A row a treatment."""
    colours = treatment_colours(names)
    for row, name in enumerate(names):
        values = runs[measure][runs["treatment"].astype(str) == name].dropna().to_numpy(float)
        if values.size:
            _box(axes, row + BOX[0], values)
            _dots(axes, row + DOTS[0], values, colours[name])
            _beside(axes, row, values)
    axes.set(xlabel=called(measure), ylim=(len(names) - 0.45, -0.45))
    axes.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)


def _box(axes: Axes, y: float, values: Array) -> None:
    """Quartiles, median and whiskers."""
    q1, median, q3 = np.quantile(values, [0.25, 0.5, 0.75])
    reach = 1.5 * (q3 - q1)
    low, high = values[values >= q1 - reach].min(), values[values <= q3 + reach].max()
    axes.hlines([y, y], [low, q3], [q1, high], color="0.4", lw=0.7, zorder=1)
    axes.barh(y, q3 - q1, BOX[1], left=q1, color="0.9", ec="0.4", lw=0.7, zorder=1)
    axes.vlines(median, y - BOX[1] / 2, y + BOX[1] / 2, color="black", lw=1.4, zorder=2)


def _dots(axes: Axes, y: float, values: Array, colour: str) -> None:
    """In the order of the values, so that neighbours lie apart."""
    aside = (np.arange(values.size) * GOLDEN % 1 - 0.5) * DOTS[1]
    axes.scatter(np.sort(values), y + aside, s=8, c=colour, lw=0, alpha=0.9, zorder=3)


def _beside(axes: Axes, y: float, values: Array) -> None:
    one = median_interval(values)
    ends = f" [{one.low:.2f}, {one.high:.2f}]" if one.low <= one.high else ""
    axes.text(
        1.02,
        y,
        f"{one.value:.2f}{ends}, n = {values.size}",
        transform=axes.get_yaxis_transform(),
        va="center",
        fontsize=SMALL_PT,
    )


def _write(
    figure: SubFigure, tests: pd.DataFrame, letters: Mapping[str, str], size_in: tuple[float, float]
) -> None:
    """A line a test."""
    rows = []
    for row in tests.to_dict("records"):
        mark = "*" if row["least_p_holm"] >= LEVEL else ""
        pair = f"{letters[row['a']]} vs {letters[row['b']]}{mark}"
        numbers = (_number(row["p"]), _number(row["p_holm"]), f"{row['a12']:.2f}")
        rows.append((pair, *numbers, str(row["magnitude"])))
    needed = least_replicates(len(tests))
    note = f"*too few replicates for a conclusion: each needs {needed} or more"
    write(figure, HEADS, rows, size_in, note if _too_few(tests) else "")


def _too_few(tests: pd.DataFrame) -> bool:
    return bool((tests["least_p_holm"] >= LEVEL).any())


def _number(p: float) -> str:
    return p_text(p).removeprefix("p").removeprefix(" = ").strip()
