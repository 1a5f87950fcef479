"""The mean of the lowest trials as fitness: of a design, of a run, and its intervals."""

import json
import math
import random
from pathlib import Path
from statistics import fmean

import pandas as pd
import pytest
from helpers import TINY, tiny
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.combining import mean
from evoros.certificate.validation import Validation, count_better, count_decisive, resample
from evoros.cli.evaluate import evaluate
from evoros.fitness.equation_one import EquationOne
from evoros.fitness.scoring import Scoring
from evoros.fitness.worst_case import WorstCase
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
    assert combine(scores * 3) <= value + 1e-6  # a share of more trials is rounded up by less
    assert WorstCase(EquationOne(), 1.0).combine(scores) == pytest.approx(mean(scores))


def test_the_share_is_rounded_up() -> None:
    scores = [4.0, 1.0, 3.0, 2.0]
    assert WorstCase(EquationOne(), 0.01).combine(scores) == 1.0
    assert WorstCase(EquationOne(), 0.25).combine(scores) == 1.0
    assert WorstCase(EquationOne(), 0.26).combine(scores) == 1.5


def test_a_team_has_the_combination_of_its_fitness() -> None:
    worst = WorstCase(EquationOne(), 0.5)
    assert Scoring(worst).combine([1.0, 3.0]) == 1.0
    assert Scoring(EquationOne()).combine is mean


def test_what_hangs_on_single_trials_has_no_interval() -> None:
    rng = random.Random(1)
    scores = [rng.gauss(0.0, 1.0) for _ in range(40)]
    assert not resample(scores, min)
    combine = WorstCase(EquationOne(), 0.25).combine
    assert [count_decisive(scores[:n], combine) for n in (0, 1, 8, 40)] == [0, 0, 2, 10]
    assert not resample(scores[:36], combine)
    assert resample(scores, combine)
    pairs = [(score, score) for score in scores]
    assert math.isnan(count_better(pairs, min))
    assert count_better(pairs, combine) == 0.5
    assert count_better([(a, b + 5.0) for a, b in pairs], combine) == 1.0


@pytest.mark.slow
def test_the_interval_covers_the_expected_shortfall_of_normal_scores() -> None:
    combine, validation = WorstCase(EquationOne(), 0.25).combine, Validation()
    expected = -1.27110  # -pdf(z) / 0.25 at the quantile z of 0.25
    rng = random.Random(7)
    covered = 0
    for _ in range(60):
        scores = [rng.gauss(0.0, 1.0) for _ in range(60)]
        low, high = validation.bound_fitness(scores, 60, combine)
        covered += low <= expected <= high
    assert covered >= 48  # nominally 57; the percentile bootstrap is a little narrow


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
    assert bounds[0] is None or bounds == sorted(bounds)
    folder = tmp_path / "again"
    scored = ["executor=serial", "fitness=worst_case", "fitness.share=0.5", "trials=4"]
    typed = [*TINY, f"designs={run}", *scored, f"hydra.run.dir={folder}"]
    assert evaluate(typed) == DONE
    (row,) = pd.read_csv(folder / "designs.csv").to_dict("records")
    status = json.loads((folder / "status.json").read_text())
    assert row["fitness"] == status["best_fitness"] <= row["fitness_mean"]
    assert tiny(tmp_path / "bad", *more, "validation.precision=0.5") == INPUT
    assert not (tmp_path / "bad").exists()
