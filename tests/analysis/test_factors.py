"""The tests of factors have the properties that statistics promises."""

import shutil
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers import tiny, vary
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from evoros.analysis.command import evoros_analyze
from evoros.analysis.statistics.effect_sizes import (
    MIN_NAMED,
    a12_interval,
    contrast_interval,
    name_magnitude,
)
from evoros.analysis.statistics.factorial import list_contrasts, permute_effects
from evoros.analysis.statistics.small_samples import a12
from evoros.base.arrays import Array
from evoros.terminal.console import DONE, INPUT

CELLS = list(product("xy", "uv"))
LEVELS = {name: [cell[i] for cell in CELLS for _ in range(5)] for i, name in enumerate("ab")}
A, B = (np.array([level in "yv" for level in LEVELS[name]], float) for name in "ab")


def p_of(values: Array) -> list[float]:
    return [test.p for test in permute_effects(values, LEVELS, 199)]


def test_f_is_that_of_a_published_example() -> None:
    """ToothGrowth of R (Crampton 1947, J. Nutr. 33, 491-504): F of aov(len ~ supp * dose)."""
    ascorbic = "4.2 11.5 7.3 5.8 6.4 10 11.2 11.2 5.2 7 16.5 16.5 15.2 17.3 22.5 17.3 13.6 14.5 "
    ascorbic += "18.8 15.5 23.6 18.5 33.9 25.5 26.4 32.5 26.7 21.5 23.3 29.5"
    juice = "15.2 21.5 17.6 9.7 14.5 10 8.2 9.4 16.5 9.7 19.7 23.3 23.6 26.4 20 25.2 25.8 21.2 "
    juice += "14.5 27.3 25.5 26.4 22.4 24.5 24.8 30.9 26.4 27.3 29.4 23"
    lengths = np.array([float(text) for text in f"{ascorbic} {juice}".split()])
    doses = [dose for _ in range(2) for dose in ("0.5", "1", "2") for _ in range(10)]
    levels = {"supp": ["VC"] * 30 + ["OJ"] * 30, "dose": doses}
    supplement, dose, both = permute_effects(lengths, levels)
    assert [test.f for test in (supplement, dose, both)] == pytest.approx(
        [15.572, 92.000, 4.107], abs=5e-4
    )
    assert [(t.freedom, t.error_freedom) for t in (supplement, dose, both)] == [
        (1, 54),
        (2, 54),
        (2, 54),
    ]
    assert both.effect == ("supp", "dose")
    assert max(supplement.p, dose.p) < 0.001
    assert both.p == pytest.approx(0.02186, abs=0.005)  # of the F distribution


@pytest.mark.parametrize("kind", ["normal", "skewed", "ceiling"])
def test_without_effects_one_test_in_twenty_is_significant(kind: str) -> None:
    rng = np.random.default_rng(3)
    values = rng.standard_normal((120, 20))
    values = {"normal": values, "skewed": np.exp(values), "ceiling": np.minimum(values, 0.0)}[kind]
    result = np.array([p_of(row) for row in values]) < 0.05
    # 120 tests at 5 %: 14 or more would be there by chance in less than 1 %.
    assert (result.sum(axis=0) <= 13).all()


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
def test_units_and_names_do_not_matter(shift: float, scale: float, seed: int) -> None:
    values = np.random.default_rng(seed).standard_normal(20)
    renamed = {"q": LEVELS["a"][::-1], "r": LEVELS["b"][::-1]}
    first = permute_effects(values, LEVELS, 49)
    for other in (
        permute_effects(shift + scale * values, LEVELS, 49),
        permute_effects(values[::-1], renamed, 49),
    ):
        assert [t.f for t in other] == pytest.approx([t.f for t in first], rel=1e-6)


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
        "(y - x) at v - at u": (11 - 4) - (3 - 1),
    }
    assert all(i.low < i.value < i.high for i in result.values())


def test_the_interval_of_a_difference_is_that_of_welch() -> None:
    """The worked example of Welch's t in the documentation of R's sleep data (Student 1908)."""
    first = [0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0]
    second = [1.9, 0.8, 1.1, 0.1, -0.1, 4.4, 5.5, 1.6, 4.6, 3.4]
    result = contrast_interval([first, second], [1.0, -1.0])
    assert (result.low, result.high) == pytest.approx((-3.3654832, 0.2054832), abs=1e-6)
    assert np.isnan(contrast_interval([[1.0], second], [1, -1]).low)
    assert contrast_interval([[2.0, 2.0]], [1.0]).low == 2.0


@pytest.mark.parametrize("difference", [0.0, 1.0, 2.0])
def test_the_interval_of_a12_covers_it(difference: float) -> None:
    rng = np.random.default_rng(5)
    true = norm.cdf(difference / np.sqrt(2))
    pairs = [(rng.standard_normal(5) + difference, rng.standard_normal(5)) for _ in range(300)]
    result = [a12_interval(*pair) for pair in pairs]
    assert np.mean([item.low <= true <= item.high for item in result]) > 0.92


SAMPLES = st.lists(st.integers(-3, 3).map(float), min_size=1, max_size=7)


@given(SAMPLES, SAMPLES)
def test_the_interval_of_a12_contains_it_and_mirrors(x: list[float], y: list[float]) -> None:
    one, other = a12_interval(x, y), a12_interval(y, x)
    assert 0 <= one.low <= one.value <= one.high <= 1
    assert one.value == a12(x, y)
    assert (1 - one.high, 1 - one.low) == pytest.approx((other.low, other.high), abs=1e-6)
    assert one.high - one.low > 0
    assert (name_magnitude(x, y) == "") == (min(len(x), len(y)) < MIN_NAMED)


# The subcommand -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Path:
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
def test_two_factors_are_drawn_and_tabled(
    sweep: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert analyze("factors", sweep, "--output", tmp_path, "--format", "svg") == DONE
    table = pd.read_csv(tmp_path / "factors.csv")
    effects = ["effect", "population_size", "effect x population_size"]
    assert list(table.effect) == effects * 2
    assert (table.df_error == 4).all()
    differences = pd.read_csv(tmp_path / "factors_effects.csv")
    assert list(differences.effect) == effects * 2
    said = capsys.readouterr().out.splitlines()
    assert sum("95 % intervals" in line for line in said) == 6
    before = (tmp_path / "factors.svg").read_bytes()
    assert analyze("factors", sweep, "--output", tmp_path, "--format", "svg") == DONE
    assert (tmp_path / "factors.svg").read_bytes() == before


def test_one_factor_is_tested_alone(sweep: Path, tmp_path: Path) -> None:
    chosen = ["--where", "effect=stuck", "--output", tmp_path, "--format", "svg"]
    assert analyze("factors", sweep, *chosen) == DONE
    assert set(pd.read_csv(tmp_path / "factors.csv").effect) == {"population_size"}


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--factors", "colour"], "--factors: must be one or two factors"),
        (["--factors", "effect"], "also differ in population_size; fix these with --where"),
        (["--factors", "effect,effect"], "--factors: must be one or two factors"),
        (["--where", "effect=stuck", "--where", "population_size=2"], "all runs are of one"),
    ],
)
def test_factors_that_cannot_be_told_are_one_line(
    options: list[str], said: str, sweep: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert analyze("factors", sweep, *options, "--output", tmp_path / "out") == INPUT
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert said in err


def test_a_combination_without_runs_and_one_without_replicates_are_one_line(
    sweep: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(sweep, tmp_path / "some")
    for seed in (1, 2):
        shutil.rmtree(tmp_path / "some" / f"stuck_3_{seed}")
    assert analyze("factors", tmp_path / "some", "--output", tmp_path / "out") == INPUT
    assert "finished runs of effect stuck, population size 3" in capsys.readouterr().err
    shutil.rmtree(tmp_path / "some")
    shutil.copytree(sweep, tmp_path / "some")
    for folder in (tmp_path / "some").glob("*_2"):
        shutil.rmtree(folder)
    assert analyze("factors", tmp_path / "some", "--output", tmp_path / "out") == INPUT
    assert "there must be replicates" in capsys.readouterr().err
