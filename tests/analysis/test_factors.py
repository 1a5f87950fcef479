"""The tests of factors have the properties that statistics promises."""

import shutil
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from fixture_types import Capture, Folders
from helpers import tiny, vary
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from evoros.analysis.command import evoros_analyze
from evoros.analysis.figures.factors import TESTS, draw_factors, list_tests
from evoros.analysis.statistics.factorial import (
    contrast_interval,
    list_contrasts,
    permute_effects,
    welch_james,
)
from evoros.analysis.statistics.two_samples import TEST, a12_interval, brunner_munzel
from evoros.base.arrays import Array
from evoros.terminal.console import DONE, INPUT

CELLS = list(product("xy", "uv"))
LEVELS = {name: [cell[i] for cell in CELLS for _ in range(5)] for i, name in enumerate("ab")}
A, B = (np.array([level in "yv" for level in LEVELS[name]], float) for name in "ab")


def p_of(values: Array) -> list[float]:
    return [test.p for test in permute_effects(values, LEVELS, 199)]


def test_f_is_that_of_scipy() -> None:
    """Welch's F of three samples, and the square of his t of two."""
    rng = np.random.default_rng(1)
    samples = [scale * rng.standard_normal(n) for n, scale in ((4, 3), (9, 1), (6, 2))]
    sizes, contrasts = np.array([4, 9, 6]), np.array([[1.0, -1.0, 0.0], [1.0, 0.0, -1.0]])
    f, freedom = welch_james(np.concatenate(samples), sizes, contrasts)
    expected = stats.f_oneway(*samples, equal_var=False)
    assert f == pytest.approx(expected.statistic)
    assert stats.f.sf(f, 2, freedom) == pytest.approx(expected.pvalue)
    f, freedom = welch_james(np.concatenate(samples[:2]), sizes[:2], contrasts[:1, :2])
    t = stats.ttest_ind(*samples[:2], equal_var=False)
    assert (f, freedom) == pytest.approx((t.statistic**2, t.df))


def test_a_contrast_of_cells_has_the_f_of_its_interval() -> None:
    rng = np.random.default_rng(2)
    cells: dict[tuple[str, ...], Array] = {
        cell: rng.standard_normal(n) for cell, n in zip(CELLS, (3, 9, 5, 4), strict=True)
    }
    values = np.concatenate(list(cells.values()))
    levels = {name: [c[i] for c, v in cells.items() for _ in v] for i, name in enumerate("ab")}
    tests = permute_effects(values, levels, 49)
    for test, contrast in zip(tests, list_contrasts(cells, {"a": "xy", "b": "uv"}), strict=True):
        half = contrast.interval.high - contrast.interval.value
        deviation = half / stats.t.ppf(0.975, test.error_freedom)
        assert test.effect == contrast.effect
        assert test.f == pytest.approx((contrast.interval.value / deviation) ** 2)


UNEQUAL = {
    "small cells scatter": ((16, 16, 4, 4), (1, 1, 4, 4)),
    "equal sizes": ((6, 6, 6, 6), (1, 1, 4, 4)),
}


@pytest.mark.parametrize("case", UNEQUAL)
def test_the_level_is_kept_at_unequal_size_and_spread(case: str) -> None:
    sizes, scales = UNEQUAL[case]
    rng, scale = np.random.default_rng(6), np.repeat(scales, sizes)
    rows = [cell for cell, n in zip(CELLS, sizes, strict=True) for _ in range(n)]
    levels = {name: [row[i] for row in rows] for i, name in enumerate("ab")}
    tested = [
        permute_effects(scale * rng.standard_normal(scale.size), levels, 199) for _ in range(200)
    ]
    wrong = np.sum([[test.p < 0.05 for test in tests] for tests in tested], axis=0)
    assert (wrong <= stats.binom.ppf(0.999, 200, 0.05)).all()


def test_one_factor_of_two_levels_has_the_test_of_compare() -> None:
    rng = np.random.default_rng(3)
    x, y = rng.standard_normal(7) + 1, 3 * rng.standard_normal(9)
    levels = {"a": ["x"] * 7 + ["y"] * 9}
    (test,) = permute_effects(np.concatenate([x, y]), levels)
    assert (test.test, test.p, test.a12) == (TEST, brunner_munzel(x, y), a12_interval(x, y))


def test_an_interaction_without_main_effects_is_found_and_main_effects_without_it() -> None:
    rng = np.random.default_rng(4)
    crossed = np.array(
        [p_of(rng.standard_normal(20) + 4 * (A - 0.5) * (B - 0.5)) for _ in range(40)]
    )
    main = np.array([p_of(rng.standard_normal(20) + 2 * A + 2 * B) for _ in range(40)])
    assert (crossed[:, 2] < 0.05).mean() > 0.4
    assert (crossed[:, :2] < 0.05).mean() < 0.15
    assert (main[:, :2] < 0.05).mean() > 0.9
    assert (main[:, 2] < 0.05).mean() < 0.15


@settings(max_examples=20, deadline=None)
@given(st.floats(-5, 5), st.floats(0.1, 10), st.integers(0, 10**6))
def test_units_order_and_names_do_not_matter(shift: float, scale: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    values, order = rng.standard_normal(20), rng.permutation(20)
    renamed = {new: [f"n{LEVELS[old][i]}" for i in order] for new, old in (("q", "a"), ("r", "b"))}
    first = permute_effects(values, LEVELS, 49)
    for other in (
        permute_effects(shift + scale * values, LEVELS, 49),
        permute_effects(values[order], renamed, 49),
    ):
        assert [t.f for t in other] == pytest.approx([t.f for t in first], rel=1e-6)
        assert [t.p for t in other] == [t.p for t in first]


def test_equal_values_have_no_effect() -> None:
    assert p_of(np.full(20, 3.3)) == [1.0, 1.0, 1.0]


def test_differences_are_those_of_the_means() -> None:
    cells: dict[tuple[str, ...], Array] = {
        ("x", "u"): np.array([0.0, 2.0]),
        ("y", "u"): np.array([1.0, 3.0, 5.0]),
        ("x", "v"): np.array([4.0, 4.0]),
        ("y", "v"): np.array([10.0, 12.0]),
    }
    result = {c.text: c.interval for c in list_contrasts(cells, {"a": ["x", "y"], "b": ["u", "v"]})}
    assert {text: round(i.value, 9) for text, i in result.items()} == {
        "y - x": (3 + 11) / 2 - (1 + 4) / 2,
        "v - u": (4 + 11) / 2 - (1 + 3) / 2,
        "(y - x) with v minus with u": (11 - 4) - (3 - 1),
    }
    assert all(i.low < i.value < i.high for i in result.values())


def test_the_interval_of_a_difference_is_that_of_welch() -> None:
    """The worked example of Welch's t in the documentation of R's sleep data (Student 1908)."""
    first = [0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0]
    second = [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4]
    result = contrast_interval([first, second], [1.0, -1.0])
    assert (result.low, result.high) == pytest.approx((-3.3654832, 0.2054832), abs=1e-6)
    assert np.isnan(contrast_interval([[1.0], second], [1, -1]).low)
    assert np.isnan(contrast_interval([[2.0, 2.0]], [1.0]).low)  # equal values show no scatter


@given(st.lists(st.floats(0, 1), min_size=2, max_size=5), st.lists(st.floats(0, 1), min_size=2))
def test_no_interval_reaches_beyond_the_bounds(x: list[float], y: list[float]) -> None:
    mean, difference = (
        contrast_interval([x, y], weights, (0.0, 1.0)) for weights in ([1.0, 0.0], [1.0, -1.0])
    )
    assert not mean.low < 0
    assert not mean.high > 1
    assert not difference.low < -1
    assert not difference.high > 1


def test_nothing_is_drawn_beyond_the_bounds() -> None:
    """Values that a maximum of 100 limits, whose means are near it."""
    rng = np.random.default_rng(8)
    cells: dict[tuple[str, ...], Array] = {
        cell: np.minimum(99 + 4 * rng.standard_normal(5), 100.0) for cell in CELLS
    }
    tests = pd.DataFrame(list(list_tests("validated", cells, ["a", "b"])), columns=list(TESTS))
    means = [contrast_interval([values], [1.0]).high for values in cells.values()]
    assert max(means) > 100
    (axes,) = draw_factors({"validated": cells}, ["a", "b"], tests, (0.0, 100.0)).axes
    drawn = np.concatenate([np.asarray(line.get_ydata(), float) for line in axes.lines])
    assert 0 <= drawn.min() <= drawn.max() <= 100


# The subcommand -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: Folders) -> Path:
    """Two settings of two levels, two seeds each."""
    folder = tmp_path_factory.mktemp("sweep")
    assert tiny(folder / "silence_2_1", "optimizer.generations=1") == DONE
    for effect, size, seed in list(product(("silence", "stuck"), (2, 3), (1, 2)))[1:]:
        config = {"failure.effect._target_": effect, "optimizer.population_size": size}
        vary(folder / "silence_2_1", folder / f"{effect}_{size}_{seed}", {**config, "seed": seed})
    vary_first = {"failure.effect._target_": "silence", "optimizer.population_size": 2}
    vary(folder / "silence_2_1", folder / "silence_2_0", vary_first)
    shutil.rmtree(folder / "silence_2_1")
    return folder


def analyze(name: str, *arguments: object) -> int:
    status: int = evoros_analyze([name, *map(str, arguments)])
    return status


@pytest.mark.slow
def test_two_factors_are_drawn_and_tabled(sweep: Path, tmp_path: Path, capsys: Capture) -> None:
    assert analyze("factors", sweep, "--output", tmp_path, "--format", "svg") == DONE
    table = pd.read_csv(tmp_path / "factors.csv")
    effects = ["effect", "population_size", "effect x population_size"]
    assert list(table.effect) == effects * 2
    assert (table.replicates == 2).all()
    differences = pd.read_csv(tmp_path / "factors_effects.csv")
    assert list(differences.effect) == effects * 2
    said = capsys.readouterr().out.splitlines()
    assert sum("with 95 % intervals" in line for line in said) == 6
    before = (tmp_path / "factors.svg").read_bytes()
    assert analyze("factors", sweep, "--output", tmp_path, "--format", "svg") == DONE
    assert (tmp_path / "factors.svg").read_bytes() == before


def test_one_factor_is_tested_alone(sweep: Path, tmp_path: Path, capsys: Capture) -> None:
    chosen = ["--where", "effect=stuck", "--output", tmp_path, "--format", "svg"]
    assert analyze("factors", sweep, *chosen) == DONE
    table = pd.read_csv(tmp_path / "factors.csv")
    assert set(table.effect) == {"population_size"}
    assert set(table.test) == {TEST}
    assert "too few replicates (2) for any conclusion" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--factors", "colour"], "--factors: must be one or two factors"),
        (
            ["--factors", "effect"],
            "also differ in population_size; choose levels of these with --where",
        ),
        (["--factors", "effect,effect"], "--factors: must be one or two factors"),
        (["--where", "effect=stuck", "--where", "population_size=2"], "all runs belong to one"),
    ],
)
def test_factors_that_cannot_be_told_are_one_line(
    options: list[str], said: str, sweep: Path, tmp_path: Path, capsys: Capture
) -> None:
    assert analyze("factors", sweep, *options, "--output", tmp_path / "out") == INPUT
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert said in err


def test_a_combination_without_runs_and_one_without_replicates_are_one_line(
    sweep: Path, tmp_path: Path, capsys: Capture
) -> None:
    shutil.copytree(sweep, tmp_path / "some")
    for seed in (1, 2):
        shutil.rmtree(tmp_path / "some" / f"stuck_3_{seed}")
    assert analyze("factors", tmp_path / "some", "--output", tmp_path / "out") == INPUT
    assert (
        "no finished run with effect stuck, population size 3 was found" in capsys.readouterr().err
    )
    shutil.rmtree(tmp_path / "some")
    shutil.copytree(sweep, tmp_path / "some")
    for folder in (tmp_path / "some").glob("*_2"):
        shutil.rmtree(folder)
    assert analyze("factors", tmp_path / "some", "--output", tmp_path / "out") == INPUT
    assert (
        "has only one finished run; at least two are needed, and 5 are better"
        in capsys.readouterr().err
    )
