"""The mean of the lowest trials as fitness: of a design, of a run, and its intervals."""

import json
import random
from collections import Counter
from itertools import combinations
from pathlib import Path
from statistics import fmean

import pandas as pd
import pytest
from helpers import TINY, tiny
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import beta, binom

from evoros.allocation.protocol import Standing, rank
from evoros.base.combining import mean
from evoros.cli.command import evaluate
from evoros.fitness.equation_one import EquationOne
from evoros.fitness.scoring import Scoring
from evoros.fitness.worst_case import WorstCase, bound_lowest
from evoros.storage.reading import load_run
from evoros.terminal.console import DONE, INPUT

SCORES = st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=40)


@given(SCORES, st.floats(0.01, 1.0), st.randoms())
def test_it_lies_between_the_lowest_trial_and_the_mean_in_any_order(
    scores: list[float], share: float, rng: random.Random
) -> None:
    combine = WorstCase(EquationOne(), share).combine
    value = combine(scores)
    assert min(scores) - 1e-6 <= value <= fmean(scores) + 1e-6
    assert combine(rng.sample(scores, len(scores))) == value
    assert combine(scores * 3) == pytest.approx(value, abs=1e-6)  # the same distribution
    assert WorstCase(EquationOne(), 1.0).combine(scores) == pytest.approx(mean(scores))


def test_the_last_trial_counts_by_its_fraction() -> None:
    scores = [4.0, 1.0, 3.0, 2.0, 5.0]
    assert WorstCase(EquationOne(), 0.01).combine(scores) == 1.0
    assert WorstCase(EquationOne(), 0.2).combine(scores) == 1.0
    assert WorstCase(EquationOne(), 0.3).combine(scores) == (1.0 + 0.5 * 2.0) / 1.5


@given(st.lists(st.integers(-50, 50).map(float), min_size=1, max_size=7), st.data())
def test_over_fewer_trials_it_is_the_mean_of_all_choices(
    scores: list[float], data: st.DataObject
) -> None:
    combine = WorstCase(EquationOne(), data.draw(st.floats(0.1, 1.0))).combine
    drawn = data.draw(st.integers(1, len(scores)))
    choices = [combine(chosen) for chosen in combinations(scores, drawn)]
    assert combine(scores, drawn) == pytest.approx(fmean(choices))
    assert combine(scores, len(scores) + drawn) == combine(scores)


@pytest.mark.parametrize("numbers", [(4, 5, 8), (4, 20)])
def test_equal_designs_with_different_numbers_of_trials_win_equally(
    numbers: tuple[int, ...],
) -> None:
    """Within 6 %; over all trials that they have, eight would win 25 % and twenty 39 %."""
    rng, combine, races = random.Random(1), WorstCase(EquationOne(), 0.25).combine, 2000
    wins = Counter[int]()
    for _ in range(races):
        standings = [
            Standing(n, (), tuple(rng.gauss(0.0, 1.0) for _ in range(n)), combine) for n in numbers
        ]
        wins[rank(standings, 0)[0].id] += 1
    assert all(abs(wins[n] / races - 1 / len(numbers)) < 0.06 for n in numbers)


def test_a_team_has_the_combination_of_its_fitness() -> None:
    worst = WorstCase(EquationOne(), 0.5)
    assert Scoring(worst).combine([1.0, 3.0]) == 1.0
    assert Scoring(EquationOne()).combine is mean


@given(st.integers(1, 60), st.data())
def test_of_lost_and_perfect_trials_the_interval_is_clopper_and_pearsons(
    trials: int, data: st.DataObject
) -> None:
    lost = data.draw(st.integers(0, trials))
    scores = [0.0] * lost + [1.0] * (trials - lost)
    low, high = bound_lowest(scores, 1.0, (0.0, 1.0), 0.95)
    wanted_low = beta.ppf(0.04, trials - lost, lost + 1) if lost < trials else 0.0
    wanted_high = beta.ppf(0.99, trials - lost + 1, lost) if lost else 1.0
    assert (low, high) == pytest.approx((wanted_low, wanted_high), abs=0.04)  # of 10,000 resamples


@given(SCORES, st.floats(0.05, 1.0))
def test_the_interval_contains_the_fitness(scores: list[float], share: float) -> None:
    low, high = bound_lowest(scores, share, (-1e6, 1e6), 0.95)
    assert -1e6 <= low <= high <= 1e6
    assert low <= WorstCase(EquationOne(), share).combine(scores) + 1e-6
    wider = bound_lowest(scores, share, (-2e6, 2e6), 0.95)
    assert wider[0] <= low
    assert high <= wider[1]


@pytest.mark.parametrize("n", [5, 40])
def test_the_interval_covers_a_quarter_of_which_one_in_25_is_a_failure(n: int) -> None:
    """An interval that covers 95 % fails once in a thousand tests."""
    rng, count, covered = random.Random(7), 150, 0
    expected = 0.04 * 3.0 + 0.96 * (17.0 + 0.5 * 0.24 / 0.99)  # one score in a hundred is 3
    for _ in range(count):
        scores = [3.0 if rng.random() < 0.01 else rng.uniform(17.0, 18.0) for _ in range(n)]
        low, high = bound_lowest(scores, 0.25, (3.0, 24.0), 0.95)
        covered += low <= expected <= high
    assert covered >= binom.ppf(0.001, count, 0.95)


@pytest.mark.slow
def test_a_run_ranks_certifies_and_evaluates_by_the_lowest_trials(tmp_path: Path) -> None:
    more = ["fitness=worst_case", "fitness.share=0.5", "trials=4", "failure=random"]
    run = tmp_path / "run"
    assert tiny(run, *more, "optimizer.validation_trials=12") == DONE
    missions = load_run(run).missions
    table = pd.read_csv(max((run / "generations").glob("*.csv")))
    fitness = dict(zip(table["id"], table["fitness"], strict=True))
    combine = WorstCase(EquationOne(), 0.5).combine
    selected = missions[missions["purpose"] == "selection"]
    for design, missions in selected.groupby("design"):
        if design in fitness:  # Eq. 1 of each trial, from the recorded outcomes
            terms = (1 + missions["progress"]) ** 2 + missions["completed"] * (
                2 - missions["time_s"] / missions["time_limit_s"]
            ) ** 2
            scores = terms.groupby(missions["trial"]).sum()
            assert len(scores) == 4
            assert fitness[design] == pytest.approx(combine(list(scores)))
    certificate = json.loads((run / "champion" / "certificate.json").read_text())
    assert certificate["recorded_fitness"] == fitness[certificate["design"]]
    bounds = [certificate[name] for name in ("fitness_low", "validated_fitness", "fitness_high")]
    assert certificate["validated_trials"] == 12
    assert bounds == sorted(bounds)
    folder = tmp_path / "again"
    scored = ["executor=serial", "fitness=worst_case", "fitness.share=0.5", "trials=4"]
    typed = [*TINY, f"designs={run}", *scored, f"hydra.run.dir={folder}"]
    assert evaluate(typed) == DONE
    (row,) = pd.read_csv(folder / "designs.csv").to_dict("records")
    status = json.loads((folder / "status.json").read_text())
    assert row["fitness"] == status["best_fitness"] <= row["fitness_mean"]
    assert tiny(tmp_path / "bad", *more, "validation.precision=0.5") == INPUT
    assert not (tmp_path / "bad").exists()


@pytest.mark.slow
@pytest.mark.parametrize("allocation", ["once", "lifelong", "racing"])
def test_fitness_is_recorded_and_validated_over_the_same_number(
    tmp_path: Path, allocation: str
) -> None:
    more = ["fitness=worst_case", "fitness.share=0.5", "trials=3", "failure=random"]
    more += [f"allocation={allocation}", "optimizer.validation_trials=1"]
    assert tiny(tmp_path / "run", *more) == DONE
    certificate = json.loads((tmp_path / "run/champion/certificate.json").read_text())
    assert certificate["validated_trials"] >= 3
    if allocation == "once":
        assert certificate["validated_trials"] == certificate["recorded_trials"] == 3
    if allocation == "lifelong":
        table = pd.read_csv(min((tmp_path / "run/generations").glob("*.csv")))
        assert certificate["validated_trials"] == 3
        assert set(table["trials"]) == {3}
