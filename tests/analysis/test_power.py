"""The replicates that a difference needs are those of theory where there is one."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from helpers import tiny, vary
from scipy import stats

from evoros.analysis.command import evoros_analyze
from evoros.analysis.statistics.power import Simulation, measure_scatter
from evoros.analysis.statistics.small_samples import LEVEL
from evoros.analysis.statistics.two_samples import brunner_munzel
from evoros.terminal.console import DONE, INPUT


@pytest.fixture(scope="module")
def normal() -> Simulation:
    rng = np.random.default_rng(1)
    scatter = measure_scatter([rng.standard_normal(300) for _ in range(2)])
    assert scatter is not None
    return Simulation(scatter, 1)


def test_without_a_difference_the_level_is_kept(normal: Simulation) -> None:
    for n in (5, 10, 30):
        assert normal.compute_power(0.0, n) == pytest.approx(0.04, abs=0.02)


def test_normal_replicates_need_as_many_as_noether_says(normal: Simulation) -> None:
    """Noether (1987), JASA 82, 645-647: an approximation for two samples of equal size."""
    for difference in (0.7, 1.0):
        p = stats.norm.cdf(difference / np.sqrt(2))
        z = stats.norm.ppf(1 - LEVEL / 2) + stats.norm.ppf(0.8)
        expected = z * z / (6 * (p - 0.5) ** 2)
        assert normal.find_replicates(difference, 0.8) == pytest.approx(expected, rel=0.15)


def test_power_grows_with_replicates_and_difference_and_falls_with_comparisons(
    normal: Simulation,
) -> None:
    powers = [normal.compute_power(1.0, n) for n in (5, 10, 20, 40)]
    assert all(one < other for one, other in pairwise(powers))
    assert normal.compute_power(1.5, 10) > normal.compute_power(1.0, 10)
    assert Simulation(normal.scatter, 6).compute_power(1.0, 20) < normal.compute_power(1.0, 20)


def test_the_power_is_that_of_the_test_itself() -> None:
    """Some simulated pairs, each tested by ``brunner_munzel``."""
    rng = np.random.default_rng(2)
    scatter = measure_scatter([rng.lognormal(size=8), rng.lognormal(size=8)])
    assert scatter is not None
    simulation = Simulation(scatter, 3, samples=200)
    first, second = simulation._noise
    result = [
        brunner_munzel(a, b) < LEVEL / 3
        for a, b in zip(first[:, :9] + 1.2, second[:, :9], strict=True)
    ]
    assert simulation.compute_power(1.2, 9) == np.mean(result)


def test_the_scatter_is_that_within_treatments() -> None:
    groups = [np.array([1.0, 2.0, 3.0]), np.array([101.0, 103.0]), np.array([7.0])]
    scatter = measure_scatter(groups)
    assert scatter is not None
    assert (scatter.residuals.size, scatter.freedom) == (5, 3)
    assert scatter.deviation.value == pytest.approx(((1 + 1 + 1 + 1) / 3) ** 0.5)
    assert scatter.deviation.low < scatter.deviation.value < scatter.deviation.high
    assert measure_scatter([np.array([1.0, 2.0])]) is None
    assert measure_scatter([np.full(5, 2.0)]) is None


@pytest.fixture(scope="module")
def pilot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pilot")
    assert tiny(folder / "run1", "optimizer.generations=1") == DONE
    for seed in (2, 3):
        vary(folder / "run1", folder / f"run{seed}", {"seed": seed}, {"best_fitness": 2.0 * seed})
    return folder


@pytest.mark.slow
def test_one_sentence_a_figure_and_tables_say_how_many(
    pilot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ["power", str(pilot), "--recorded", "--comparisons", "3", "--output", str(tmp_path)]
    capsys.readouterr()
    assert evoros_analyze([*given, "--difference", "1000", "--format", "svg"]) == DONE
    (sentence, shortfall, *files) = capsys.readouterr().out.splitlines()
    assert "replicates per treatment detect" in sentence
    assert "Holm over 3 comparisons" in sentence
    assert "standard deviation: " in shortfall
    assert len(files) == 3
    row = pd.read_csv(tmp_path / "power.csv").iloc[0]
    assert row.replicates_low <= row.replicates <= row.replicates_high
    assert f" {row.replicates:.0f} replicates" in sentence
    assert row.runs == 3
    curve = pd.read_csv(tmp_path / "power_curves.csv")
    assert curve.power.is_monotonic_increasing


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--difference", "-1"], "--difference: must be"),
        (["--difference", "nan"], "--difference: must be"),
        (["--power", "1"], "--power: must be"),
        (["--comparisons", "0"], "--comparisons: must be"),
    ],
)
def test_options_out_of_range_are_one_line(
    options: list[str], said: str, pilot: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert evoros_analyze(["power", str(pilot), *options]) == INPUT
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert said in err


def test_too_few_runs_are_one_line(pilot: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert evoros_analyze(["power", str(pilot / "run1")]) == INPUT
    assert "seeds of one treatment to estimate power" in capsys.readouterr().err
