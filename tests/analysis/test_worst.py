"""Failures that stop a design: cases, sets and risks of evaluations and tables made by hand."""

from collections import Counter
from pathlib import Path

import pandas as pd
import pytest
from fixture_types import Capture, Folders
from scipy import stats

from evoros.analysis.command import evoros_analyze
from evoros.analysis.statistics.worst_cases import (
    count_sets,
    estimate_risks,
    find_smallest,
    list_cases,
)
from evoros.cli.command import evaluate
from evoros.failure.exhaustive import ExhaustiveFailure
from evoros.session.replay import replay_row
from evoros.terminal.console import DONE, INPUT

DESIGN = "design,sensor,x_m,y_m,yaw_deg\na,0,0.2,0.05,10\na,1,0.2,-0.05,-10\nb,0,0.2,0.05,30\n"


def mission(
    failed: str, time: float | None, completed: bool, world: str = "near", trial: int = 0
) -> dict[str, object]:
    return {
        "source": "s", "design": "d", "world": world, "trial": trial, "completed": completed,
        "failed_sensors": failed, "failed_at_s": time, "evaluation": "e", "drawn": True,
        "intact": not failed and completed,
    }  # fmt: skip


def test_the_smallest_set_is_the_one_with_the_fewest_sensors() -> None:
    table = pd.DataFrame([
        mission("", None, True),
        mission("", None, False),  # ended before the failure, which therefore says nothing
        mission("0", 40.0, True),
        mission("2", 40.0, True),
        mission("1 2", 40.0, False),
        mission("1 2", 40.0, False, "far"),
        mission("1 2", 80.0, True),
        mission("0 1 2", 40.0, False),
    ])  # fmt: skip
    cases = list_cases(table)
    assert list(cases["failed"]) == [0, 1, 1, 2, 2, 3]
    (smallest,) = find_smallest(cases).to_dict("records")
    assert smallest["failed_sensors"] == "1 2"
    assert smallest["failed_at_s"] == 40.0
    assert smallest["stopped_in"] == "near far"
    sets = count_sets(cases, {("s", "d"): 3}).set_index("failed")
    assert list(sets["sets"]) == [1, 2, 1, 1]
    assert list(sets["of"]) == [1, 3, 3, 1]
    assert list(sets["stopping"]) == [0, 0, 1, 1]
    assert list(sets["stopped"]) == [0, 0, 2, 1]


def test_nothing_that_stops_is_no_smallest_set() -> None:
    cases = list_cases(pd.DataFrame([mission("", None, True), mission("0", 1.0, True)]))
    assert find_smallest(cases).empty


def test_a_trial_fails_if_one_of_its_missions_does() -> None:
    lost = {("near", 1), ("far", 2), ("far", 1)}
    rows = [
        mission("0", 40.0, (world, trial) not in lost, world, trial)
        for trial in range(10)
        for world in ("near", "far")
    ]
    risks = estimate_risks(pd.DataFrame(rows)).set_index("world")
    assert risks.loc["near", "risk"] == 0.1
    assert risks.loc["far", "risk"] == 0.2
    assert risks.loc["", "risk"] == 0.2
    interval = stats.binomtest(2, 10).proportion_ci(method="exact")
    assert risks.loc["", "risk_low"] == pytest.approx(interval.low, abs=1e-6)
    assert risks.loc["", "risk_high"] == pytest.approx(interval.high, abs=1e-6)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: Folders) -> Path:
    """Two designs in all cases of up to two sensors."""
    top = tmp_path_factory.mktemp("worst")
    (top / "two.csv").write_text(DESIGN)
    times = (0.0, 2.0)
    trials = ExhaustiveFailure(times_s=times).count_cases(2)
    base = ["simulator=planar", "executor=serial", "course.time_limit_s=8", "world=maze"]
    more = ["failure=exhaustive", f"failure.times_s={list(times)}", f"trials={trials}"]
    named = [f"designs={top / 'two.csv'}", f"hydra.run.dir={top / 'all'}"]
    assert evaluate([*base, *more, *named]) == DONE
    return top / "all"


def test_an_exhaustive_evaluation_meets_every_set(folder: Path, capsys: Capture) -> None:
    assert evoros_analyze(["worst", str(folder), "--format", "svg"]) == DONE
    sets = pd.read_csv(folder / "figures" / "worst_sets.csv")
    assert (sets["sets"] == sets["of"]).all()
    assert set(zip(sets["design"], sets["failed"], strict=True)) == {
        ("a", 0), ("a", 1), ("a", 2), ("b", 0), ("b", 1),
    }  # fmt: skip
    said = capsys.readouterr().out
    assert "design a of" in said
    assert "all sets of up to 2 were tried" in said or "other cases" in said
    risks = pd.read_csv(folder / "figures" / "worst_risks.csv")
    assert risks.empty  # cases that are not drawn say nothing of a probability
    met = pd.read_csv(folder / "missions.csv").groupby("design")["case"].agg(list)
    assert sorted(Counter(met["a"]).values()) == [1] * 7  # no, one or two sensors, at two times
    assert sorted(Counter(met["b"]).values()) == [2, 2, 3]  # no sensor or one


def test_a_mission_of_an_exhaustive_evaluation_is_replayed_under_its_case(folder: Path) -> None:
    for trial in range(7):
        replayed = replay_row(folder, {"design": "a", "trial": f"{trial}"})
        assert replayed.outcomes == replayed.recorded


def test_a_design_is_chosen_by_its_name(folder: Path, capsys: Capture) -> None:
    assert evoros_analyze(["worst", str(folder), "--design", "b", "--format", "svg"]) == DONE
    assert evoros_analyze(["worst", str(folder), "--design", "c"]) == INPUT
    assert "--design: 'c' is not a design of the evaluations" in capsys.readouterr().err
