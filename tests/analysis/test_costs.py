"""Searches are compared at the same cost: missions, simulated or processor time."""

import json
import shutil
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from fixture_types import Capture, Folders, Patch
from helpers import reseal, tiny
from hypothesis import given
from hypothesis import strategies as st

from evoros.analysis.command import evoros_analyze
from evoros.analysis.statistics.comparison import compare_reached, compare_treatments
from evoros.analysis.statistics.small_samples import share_interval
from evoros.analysis.tables.costs import (
    AXES,
    average,
    compute_quartiles,
    find_first,
    hold_race,
    read_best_within,
    read_costs,
)
from evoros.analysis.tables.loading import load_study
from evoros.analysis.tables.study import Study
from evoros.terminal.console import DONE, INPUT

STEPS = pd.Series([1.0, 4.0, 2.0], [10.0, 20.0, 50.0])
"""1 from 10 on, 4 from 20 on, 2 from 50 on."""


@pytest.mark.parametrize(
    ("start", "end", "area"),
    [(10, 20, 10), (10, 50, 130), (20, 60, 140), (12, 18, 6), (45, 55, 30)],
)
def test_the_area_under_a_step_curve_is_exact(start: float, end: float, area: float) -> None:
    assert average(STEPS, (start, end)) * (end - start) == pytest.approx(area)


def test_the_mean_over_a_span_without_length_is_the_value_there() -> None:
    assert average(STEPS, (20, 20)) == 4.0


@given(st.lists(st.floats(-9, 9), min_size=1, max_size=9), st.floats(-9, 9))
def test_the_mean_is_between_the_values_and_follows_their_scale(
    values: list[float], shift: float
) -> None:
    curve = pd.Series(values, np.arange(1.0, len(values) + 1))
    span = (1.0, float(len(values)))
    mean = average(curve, span)
    assert min(values) - 1e-9 <= mean <= max(values) + 1e-9
    assert average(curve + shift, span) == pytest.approx(mean + shift, abs=1e-9)


@pytest.mark.parametrize(("target", "cost"), [(1.0, 10), (1.5, 20), (4.0, 20), (4.1, np.inf)])
def test_a_target_is_reached_at_the_first_cost_with_this_fitness(
    target: float, cost: float
) -> None:
    assert find_first(STEPS, target) == cost


def run_of(name: str, costs: Sequence[int], fitness: Sequence[float]) -> pd.DataFrame:
    numbers = range(len(costs))
    columns = {"generation": numbers, "missions": costs, "fitness": fitness}
    return pd.DataFrame({"run": name, "treatment": "t", **columns}).assign(validated_fitness=np.nan)


def test_quartiles_hold_the_last_generation_of_each_run_until_its_end() -> None:
    runs = pd.concat([run_of("a", [10, 30], [1.0, 3.0]), run_of("b", [20, 40], [2.0, 8.0])])
    table = compute_quartiles(runs, "missions").set_index("missions")
    assert table["replicates"].to_dict() == {10: 1, 20: 2, 30: 2, 40: 1}
    assert table["recorded_median"].to_dict() == {10: 1.0, 20: 1.5, 30: 2.5, 40: 8.0}


def test_a_generation_without_missions_replaces_the_one_before() -> None:
    table = compute_quartiles(run_of("a", [10, 10, 20], [1.0, 2.0, 3.0]), "missions")
    assert table["recorded_median"].tolist() == [2.0, 3.0]


@pytest.mark.parametrize("reached", [0, 2, 5])
def test_shares_have_exact_intervals_up_to_none_and_all(reached: int) -> None:
    costs = [1.0] * reached + [np.nan] * (5 - reached)
    runs = pd.DataFrame({"treatment": ["a"] * 5 + ["b"] * 5, "cost": costs + [np.nan] * 5})
    runs["score"] = range(10)
    table = compare_reached(compare_treatments(runs, ["score"]), runs, "cost")
    (row,) = table.to_dict("records")
    expected = share_interval(reached, 5)
    known = [row[name] for name in ("reached_a", "reached_low_a", "reached_high_a")]
    assert known == [expected.value, expected.low, expected.high]
    assert row["reached_b"] == 0.0
    assert row["p_reached_holm"] == pytest.approx({0: 1.0, 2: 4 / 9, 5: 2 / 126}[reached])
    assert [row["p_holm"], row["least_p_holm"]] == pytest.approx([2 / 126, 2 / 126])
    assert row["tests"] == 2


# With runs -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory: Folders) -> Path:
    top = tmp_path_factory.mktemp("costs")
    for size in (3, 4):
        for seed in (1, 2):
            words = (f"optimizer.population_size={size}", f"seed={seed}")
            run = top / f"{size}_{seed}"
            assert tiny(run, *words, "optimizer.generations=3") == DONE
    return top


@pytest.fixture(scope="module")
def study(folder: Path) -> Study:
    return load_study([folder])


def test_costs_are_the_missions_on_which_the_search_depends(study: Study) -> None:
    for record in study.records:
        missions = record.run.missions
        chosen = missions[missions["purpose"] == "selection"]
        costs = read_costs(record, "missions")
        assert costs.iloc[-1] == len(chosen) < len(missions)
        assert costs.is_monotonic_increasing
        simulated = read_costs(record, "simulated_s")
        assert simulated.iloc[-1] == pytest.approx(chosen["time_s"].sum())
        assert read_costs(record, "generation").tolist() == [0, 1, 2]


def test_a_run_without_processor_times_is_one_line(
    folder: Path, tmp_path: Path, capsys: Capture
) -> None:
    """As on a GPU, or of a run whose status was lost."""
    run = shutil.copytree(folder / "3_1", tmp_path / "run")
    file = run / "status.json"
    status = json.loads(file.read_text()) | {"processor_s": []}
    file.write_text(json.dumps(status))
    reseal(run)
    assert evoros_analyze(["fitness", str(run), "--axis", "processor_s"]) == INPUT
    err = capsys.readouterr().err
    assert "did not record the processor time" in err
    assert err.count("\n") == 1


def test_processor_times_grow_by_generation(study: Study) -> None:
    for record in study.records:
        costs = read_costs(record, "processor_s")
        assert len(costs) == 3
        assert 0 < costs.iloc[0] <= costs.iloc[1] <= costs.iloc[2]


def test_a_race_ends_where_the_first_run_ends(study: Study) -> None:
    race = hold_race(study, "missions", None, None)
    ends = [read_costs(record, "missions") for record in study.records]
    assert race.span == (max(cost.iloc[0] for cost in ends), min(cost.iloc[-1] for cost in ends))
    assert race.runs[race.measure].notna().all()


def test_a_target_that_all_runs_have_from_the_start_is_reached_there(study: Study) -> None:
    race = hold_race(study, "missions", None, -1e6)
    firsts = {r.name: float(read_costs(r, "missions").iloc[0]) for r in study.records}
    assert dict(zip(race.runs["run"], race.runs[race.reached], strict=True)) == firsts


def test_the_best_design_of_the_whole_budget_is_the_champion(study: Study) -> None:
    record = study.records[0]
    end = float(read_costs(record, "missions").iloc[-1])
    best, champion = read_best_within(record, "missions", end), record.run.champion
    assert set(best["design"]) == set(champion["design"])


@pytest.mark.parametrize(
    ("figure", "axis"),
    [*product(["fitness", "compare"], AXES), ("strategies", "missions")],
)
def test_each_figure_takes_each_axis(
    figure: str, axis: str, folder: Path, tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    monkeypatch.setattr("evoros.analysis.command.render", lambda *_, **__: b"")
    words = [figure, str(folder), "--axis", axis, "--output", str(tmp_path)]
    status, err = evoros_analyze(words), capsys.readouterr().err
    compiled = axis == "processor_s" and "the first generation of " in err  # before the others
    assert compiled or (status, err) == (DONE, "")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--axis", "missions", "--budget", "0"], "--budget: must be from "),
        (["--axis", "generation", "--budget", "0"], "above 0, not 0; change the budget"),
        (["--axis", "missions", "--budget", "9999"], ", not 9999; "),
        (["--axis", "missions", "--target", "1e6"], "--target: no run reaches 1e+06 by "),
        (["--target", "3"], "--target: needs the option --axis; add --axis missions"),
        (["--budget", "3"], "--budget: needs the option --axis; add --axis missions"),
        (["--reference", "none"], "--reference: 'none' is not a treatment; choose one of 'pop"),
    ],
)
def test_impossible_comparisons_are_one_line(
    words: list[str], told: str, folder: Path, tmp_path: Path, capsys: Capture
) -> None:
    assert evoros_analyze(["compare", str(folder), *words, "--output", str(tmp_path)]) == INPUT
    err = capsys.readouterr().err
    assert told in err
    assert err.count("\n") == 1


def test_a_reference_has_one_test_for_each_other_treatment() -> None:
    runs = pd.DataFrame({"treatment": [*"abcdef"] * 5, "recorded": range(30)})
    table = compare_treatments(runs, ["recorded"], "c")
    assert list(zip(table["a"], table["b"], strict=True)) == [
        ("a", "c"),
        ("b", "c"),
        ("c", "d"),
        ("c", "e"),
        ("c", "f"),
    ]
