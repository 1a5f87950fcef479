"""Figures of statistics with names, numbers and units as long as a user's own."""

from itertools import product

import numpy as np
import pandas as pd
import pytest
from figure_checks import find_faults
from helpers import texts
from matplotlib.figure import Figure

from evoros.analysis.drawing.style import COLUMN_IN, PAGE_IN, finish, use_style
from evoros.analysis.figures.compare import draw_comparison
from evoros.analysis.figures.factors import TESTS, draw_factors, list_tests
from evoros.analysis.figures.power import draw_power
from evoros.analysis.statistics.comparison import MEASURES, compare_treatments, conclude
from evoros.base.arrays import Array

LABEL = "delivery score with all deductions [points]"
LEVELS = ("random_search", "map_elites_with_noise", "genetic_algorithm", "cma_es")
WIDTHS = pytest.mark.parametrize("width", [COLUMN_IN, PAGE_IN])


def find_faults_of(figure: Figure) -> list[str]:
    finish(figure)
    with use_style():
        return find_faults(figure)


def read_words(figure: Figure) -> str:
    return " ".join(" ".join(text.get_text() for text in texts(figure)).split())


def make_runs(scale: float) -> pd.DataFrame:
    rng = np.random.default_rng(0)
    scores = [
        dict(zip(MEASURES, scale * (1 + 0.01 * rng.random(2)), strict=True)) for _ in range(20)
    ]
    return pd.DataFrame(scores).assign(run=range(20), treatment=[*LEVELS] * 5)


@WIDTHS
@pytest.mark.parametrize("scale", [1.0, 1e5])
def test_a_comparison_keeps_its_words_and_numbers_apart(width: float, scale: float) -> None:
    runs = make_runs(scale)
    figure = draw_comparison(runs, compare_treatments(runs), width, LABEL)
    assert find_faults_of(figure) == []
    assert f"recorded {LABEL}" in read_words(figure)


def test_conclusions_call_the_fitness_as_the_figures_do() -> None:
    runs = make_runs(1.0)
    for line in conclude(compare_treatments(runs), LABEL):
        assert line.startswith(tuple(f"{measure} {LABEL}, " for measure in MEASURES))


@WIDTHS
def test_factors_keep_ticks_and_probabilities_apart(width: float) -> None:
    rng, names = np.random.default_rng(0), ["optimizer_of_the_study", "agents_in_the_way"]
    cells: dict[str, dict[tuple[str, ...], Array]] = {
        measure: {
            (level, other): 1000.0**k * i + rng.random(5)
            for i, (level, other) in enumerate(product(LEVELS, ("none", "several_people")))
        }
        for k, measure in enumerate(MEASURES)  # ticks of one digit above ticks of four
    }
    tests = [test for measure in MEASURES for test in list_tests(measure, cells[measure], names)]
    table = pd.DataFrame(tests, columns=list(TESTS))
    assert (table.p < 0.001).any()  # "< 0.001" is the widest
    figure = draw_factors(cells, names, table, width=width, label=LABEL)
    assert find_faults_of(figure) == []


def test_a_power_says_of_which_quantity_the_difference_is() -> None:
    plan = {"difference": 2.0, "in_sd": 1.0, "replicates": 20.0}
    plan |= {"replicates_low": 10.0, "replicates_high": 30.0}
    curve = {"difference": 2.0, "replicates": [2, 40], "power": [0.1, 0.9]}
    figure = draw_power(pd.DataFrame(curve), [plan], 0.8, COLUMN_IN, LABEL)
    assert find_faults_of(figure) == []
    assert f"difference in {LABEL}" in read_words(figure)
