"""Two versions of a stack under the same draws: pairs, exact tests, margins, statuses."""

import re
import shlex
import shutil
from functools import partial
from itertools import product
from math import comb, sqrt
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pandas as pd
import pytest
from documents import columns, text
from figure_checks import find_faults
from helpers import TINY, refused, reseal, scored, tiny, vary
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from evoros.analysis.command import evoros_analyze
from evoros.analysis.figures import regression
from evoros.analysis.statistics.regression import (
    MIN_CHANGED,
    bounded_change_interval,
    change_interval,
    compare_missions,
    judge_margins,
    mcnemar,
    share_change_interval,
    sign_flips,
)
from evoros.analysis.subcommands import parse
from evoros.analysis.tables.loading import load_study
from evoros.analysis.tables.pairs import QUANTITIES, TIME
from evoros.cli.main import evoros
from evoros.terminal.console import DONE, NOT_DECIDED, NOT_MET

COUNTS = st.integers(0, 30)
SLOW = "controller.navigation.speed_mps=0.15"
TRIALS = 25

# Tests and intervals -------------------------------------------------------------------------


@given(COUNTS, COUNTS)
def test_mcnemar_is_twice_the_binomial_tail(gained: int, lost: int) -> None:
    n = gained + lost
    tail = sum(comb(n, k) for k in range(min(gained, lost) + 1)) / 2**n
    assert mcnemar(gained, lost) == pytest.approx(min(1.0, 2 * tail))


def test_five_lost_missions_and_none_gained_are_too_few() -> None:
    assert mcnemar(0, 5) == 2 / 32
    assert mcnemar(0, 6) == 2 / 64


DIFFERENCES = st.lists(st.integers(-20, 20).map(lambda k: k / 8), min_size=1, max_size=9)


@given(DIFFERENCES)
def test_signs_are_flipped_in_all_ways(differences: list[float]) -> None:
    """Multiples of an eighth have exact sums."""
    values = np.array(differences)
    sums = np.array([np.dot(signs, values) for signs in product((-1, 1), repeat=len(values))])
    tails = [np.mean(sums >= values.sum()), np.mean(sums <= values.sum())]
    assert sign_flips(values) == pytest.approx(min(1.0, 2 * min(tails)))


@given(COUNTS, COUNTS, st.integers(0, 20))
def test_flips_of_a_share_are_mcnemar(gained: int, lost: int, equal: int) -> None:
    values = np.array([1.0] * gained + [-1.0] * lost + [0.0] * equal)
    assert sign_flips(values) == mcnemar(gained, lost)


def test_neither_order_nor_side_changes_a_p() -> None:
    rng = np.random.default_rng(1)
    values = rng.normal(0.3, 1.0, 60)  # so many that signs are drawn
    p = sign_flips(values)
    assert 0 < p < 1
    assert sign_flips(rng.permutation(values)) == p
    assert sign_flips(-values) == pytest.approx(p, abs=0.02)
    assert sign_flips(np.abs(values)) == pytest.approx(2 / 10_000)  # the fewest of 9999 drawn


Z = NormalDist().inv_cdf(0.975)


@given(st.integers(1, 500))
def test_a_share_that_does_not_change_has_an_interval(pairs: int) -> None:
    change = share_change_interval(0, 0, pairs)
    assert change.value == 0
    assert change.high == pytest.approx(Z**2 / (pairs + Z**2))
    assert change.low == -change.high


@given(COUNTS, COUNTS, COUNTS)
def test_the_interval_excludes_no_change_as_the_score_test_does(
    gained: int, lost: int, equal: int
) -> None:
    pairs = gained + lost + equal
    if not gained + lost:
        return
    change = share_change_interval(gained, lost, pairs)
    assert change == -share_change_interval(lost, gained, pairs)
    assert -1 <= change.low <= change.value <= change.high <= 1
    score = (gained - lost) / sqrt(gained + lost)
    assert (change.low > 1e-9) == (score > Z + 1e-9)
    assert (change.high < -1e-9) == (score < -Z - 1e-9)


@pytest.mark.parametrize(("gained", "lost", "pairs"), [(3, 12, 60), (9, 1, 20), (1, 1, 8)])
def test_at_the_bounds_the_score_has_its_quantile(gained: int, lost: int, pairs: int) -> None:
    """The likelihood at a given change is maximized here by search."""
    change = share_change_interval(gained, lost, pairs)
    for bound, z in ((change.low, Z), (change.high, -Z)):

        def loss(q: float, bound: float = bound) -> float:
            rest = pairs - gained - lost
            return -float(
                gained * np.log(q + bound) + lost * np.log(q) + rest * np.log(1 - 2 * q - bound)
            )

        limits = (max(0, -bound) + 1e-12, (1 - bound) / 2 - 1e-12)
        q = minimize_scalar(loss, bounds=limits, method="bounded", options={"xatol": 1e-13}).x
        variance = pairs * (2 * q + bound * (1 - bound))
        assert (gained - lost - pairs * bound) / sqrt(variance) == pytest.approx(z, abs=1e-4)


@pytest.mark.parametrize("share", [0.01, 0.1])
def test_a_rare_change_of_progress_is_covered(share: float) -> None:
    rng = np.random.default_rng(4)
    lost = np.where(rng.random((100, 60)) < share, -rng.uniform(0.2, 0.9, (100, 60)), 0.0)
    intervals = [bounded_change_interval(row) for row in lost]
    assert sum(not one.low <= -0.55 * share <= one.high for one in intervals) <= 5
    assert all(-1 <= one.low < one.value < one.high <= 1 for one in intervals)


def test_few_changes_without_bounds_have_no_interval() -> None:
    values = np.zeros(200)
    values[: MIN_CHANGED - 1] = 1.0
    assert np.isnan(change_interval(values).low)
    values[MIN_CHANGED] = 3.0
    assert 0 < change_interval(values).low < values.mean()


# Tables ----------------------------------------------------------------------------------------


def make_pairs(lost: dict[str, int], trials: int = 40) -> pd.DataFrame:
    """Missions of which all are completed in A, and the first few of each world not in B."""
    rows = [
        {
            "design": "d", "world": world, "trial": trial, "completed_a": 1,
            "completed_b": int(trial >= count), "progress_a": 1.0, "progress_b": 1.0,
            "collisions_a": 0.0, "collisions_b": 0.0,
            "completion_time_s_a": 10.0, "completion_time_s_b": 10.0 if trial >= count else np.nan,
        }
        for world, count in lost.items()
        for trial in range(trials)
    ]  # fmt: skip
    return pd.DataFrame(rows)


def test_all_worlds_and_each_are_tested_and_adjusted_together() -> None:
    """Ten missions lost in one world; nothing else changes, which is no test."""
    made = compare_missions(make_pairs({"hall": 10, "maze": 0}), list(QUANTITIES))
    completed = made[made["quantity"] == "completed"].set_index("world")
    assert list(completed["missions"]) == [80, 40, 40]
    assert list(completed["both"]) == [70, 30, 40]
    assert list(completed["worse"]) == [10, 10, 0]
    assert list(completed["p"]) == [2 / 2**10, 2 / 2**10, 1.0]
    assert list(completed["p_holm"]) == [4 / 2**10, 4 / 2**10, 1.0]
    assert list(completed["result"]) == ["worse", "worse", "unchanged"]
    assert set(made.loc[made["quantity"] != "completed", "p_holm"]) == {1.0}


@pytest.mark.parametrize(("later_s", "result"), [(0.1, "unchanged"), (1.0, "worse")])
def test_times_within_a_percent_are_unchanged(later_s: float, result: str) -> None:
    pairs = make_pairs({"hall": 0}).assign(completion_time_s_a=74.0)
    made = compare_missions(pairs.assign(completion_time_s_b=74.0 + later_s), [TIME])
    assert list(made["result"]) == [result]
    assert list(made["worse"]) == [0 if result == "unchanged" else len(pairs)]


@given(st.integers(0, 20), st.integers(0, 20))
def test_worlds_that_change_alike_show_no_more_than_one(lost: int, kept: int) -> None:
    """They share the draws of a trial, so that three of them are not three times the trials."""
    alike = make_pairs(dict.fromkeys(("hall", "maze", "yard"), lost), lost + kept + 1)
    made = compare_missions(alike, ["completed"]).set_index("world")
    for column in ("p", "difference"):
        values = dict(made[column])
        assert values[""] == values["hall"]


def test_the_order_of_the_rows_changes_nothing() -> None:
    pairs = make_pairs({"hall": 10, "maze": 3})
    shuffled = pairs.sample(frac=1.0, random_state=1)
    pd.testing.assert_frame_equal(
        compare_missions(shuffled, list(QUANTITIES)), compare_missions(pairs, list(QUANTITIES))
    )
    margins = {"completed": 0.1, "progress": 0.2}
    pd.testing.assert_frame_equal(
        judge_margins(shuffled, margins, 0.95), judge_margins(pairs, margins, 0.95)
    )


def test_one_world_does_not_hide_another_within_a_margin() -> None:
    judged = judge_margins(make_pairs({"hall": 40, "maze": 0}), {"completed": 0.3}, 0.95)
    assert dict(zip(judged["world"], judged["result"], strict=True)) == {
        "hall": "violated",
        "maze": "met",
    }


@pytest.mark.slow
def test_a_margin_is_rarely_met_by_a_change_as_large() -> None:
    """At the limit itself, at most 5 % of the results are wrong, however many trials there are."""
    rng = np.random.default_rng(1)
    met = 0
    for _ in range(400):
        pairs = make_pairs({"hall": 0}, 150)
        pairs["completed_b"] = (rng.random(len(pairs)) >= 0.2).astype(int)
        (result,) = judge_margins(pairs, {"completed": 0.2}, 0.95)["result"]
        met += result == "met"
    assert met <= 400 * 0.05 + 3 * sqrt(400 * 0.05 * 0.95)


# Folders ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def top(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two designs with a controller, and with one that is too slow for the time limit."""
    folder = tmp_path_factory.mktemp("versions")
    (folder / "two.csv").write_text("design,sensor,x_m,y_m,yaw_deg\na,0,0.2,0,0\nb,0,0.1,0,-60\n")
    (folder / "one.csv").write_text("design,sensor,x_m,y_m,yaw_deg\na,0,0.2,0,0\n")
    scored(folder / "before", folder / "two.csv", f"trials={TRIALS}")
    scored(folder / "after", folder / "two.csv", f"trials={TRIALS - 5}", SLOW)
    shutil.copytree(folder / "before", folder / "same")
    return folder


def compare(one: Path, other: Path, output: Path, *more: str) -> int:
    return evoros_analyze(["regression", str(one), str(other), f"--output={output}", *more])


def read(output: Path, name: str = "regression") -> pd.DataFrame:
    return pd.read_csv(output / f"{name}.csv", keep_default_na=False)


def test_equal_folders_show_no_change(top: Path, tmp_path: Path) -> None:
    assert compare(top / "before", top / "same", tmp_path) == DONE
    tests = read(tmp_path)
    assert set(tests["p"]) == set(tests["p_holm"]) == {1.0}
    assert set(tests["difference"]) == {0.0}
    missions = read(tmp_path, "regression_missions")
    assert set(missions["change"]) == {"same"}
    assert len(missions) == 2 * 2 * TRIALS


def test_a_time_within_one_percent_is_no_change(top: Path, tmp_path: Path) -> None:
    """Of two designs, one becomes slower by 0.9 %, the other by 1.1 %."""
    slower = tmp_path / "slower"
    shutil.copytree(top / "before", slower)
    missions = pd.read_csv(slower / "missions.csv")
    missions["time_s"] *= np.where(missions["design"] == "a", 1.009, 1.011)
    missions.to_csv(slower / "missions.csv", index=False)
    reseal(slower)
    compare(top / "before", slower, tmp_path / "out")
    completed = read(tmp_path / "out", "regression_missions").query("completed_a == 1")
    assert set(zip(completed["design"], completed["change"], strict=True)) == {
        ("a", "same"),
        ("b", "worse"),
    }


def test_an_injected_regression_is_found(
    top: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Common trials count. In near every mission is lost; nobody ever completes far."""
    assert compare(top / "before", top / "after", tmp_path) == NOT_MET
    tests = {(r["design"], r["world"], r["quantity"]): r for r in read(tmp_path).to_dict("records")}
    for design in "ab":
        near, far = (tests[design, world, "completed"] for world in ("near", "far"))
        assert (near["missions"], near["worse"], near["result"]) == (
            TRIALS - 5,
            TRIALS - 5,
            "worse",
        )
        assert (far["neither"], far["p"], far["result"]) == (f"{TRIALS - 5}.0", 1.0, "unchanged")
    missions = read(tmp_path, "regression_missions")
    lost = missions["change"] == "lost"
    assert lost.sum() == 2 * (TRIALS - 5)
    assert lost[: lost.sum()].all()  # the worst first
    printed = capsys.readouterr().out
    assert "the folders differ in controller" in printed
    assert f"missions: {lost.sum()} lost, 0 gained" in printed
    again = re.findall(r"replay in ([AB]): (evoros replay .*)", printed)
    assert [side for side, _ in again] == ["A", "B"] * regression.SHOWN
    outcomes = []
    for _, command in again[:2]:
        assert evoros([*shlex.split(command)[1:], *TINY[:2]]) == DONE
        outcomes.append("ended                       completed" in capsys.readouterr().out)
    assert outcomes == [True, False]


def test_an_improvement_is_no_regression(top: Path, tmp_path: Path) -> None:
    assert compare(top / "after", top / "before", tmp_path, "--of", "completed") == DONE
    tests = read(tmp_path)
    assert set(tests["quantity"]) == {"completed"}
    assert set(tests.loc[tests["world"] == "near", "result"]) == {"better"}


def test_a_margin_decides_the_status(top: Path, tmp_path: Path) -> None:
    before, same, after = (top / name for name in ("before", "same", "after"))
    assert compare(before, same, tmp_path, "--margin", "completed=0.2") == DONE
    assert compare(before, same, tmp_path, "--margin=completed=0.2", "--margin=progress=0.01") == (
        NOT_DECIDED
    )
    assert compare(before, after, tmp_path, "--margin", "completed=0.2") == NOT_MET
    judged = read(tmp_path, "regression_margins")
    results = dict(zip(judged["world"], judged["result"], strict=True))
    assert results == {"near": "violated", "far": "met"}


def test_its_tables_have_the_columns_of_the_document(top: Path, tmp_path: Path) -> None:
    assert compare(top / "before", top / "same", tmp_path, "--margin=completed=0.2") == DONE
    for file in sorted(tmp_path.glob("*.csv")):
        rows = columns(text("analysis"), file.name)
        assert [name for first, _ in rows for name in re.findall(r"\w+", first)] == list(
            pd.read_csv(file).columns
        )


@pytest.mark.parametrize(("margin", "trials"), [(0.05, 73), (0.01, 370)])
def test_trials_that_show_a_margin_if_nothing_changes(margin: float, trials: int) -> None:
    """As docs/analysis.md says."""
    judged = judge_margins(make_pairs({"hall": 0}, 400), {"completed": margin}, 0.95)
    assert list(judged["trials"]) == [trials]
    words = " ".join(text("analysis").split())
    assert "a margin of 0.05 needs 73 trials, and a margin of 0.01 needs 370" in words


@pytest.mark.parametrize("name", ["same", "after"])
def test_the_figure_can_be_read(top: Path, name: str) -> None:
    study = load_study([top / "before", top / name])
    made = regression.make_product(study, parse(["regression", ".", "--design", "b"]))
    assert made.figure is not None
    assert find_faults(made.figure) == []


@pytest.mark.slow
def test_runs_are_compared_by_the_validations_of_their_champions(
    top: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    short = ("optimizer.generations=1", "optimizer.validation_trials=8")
    for name, more in (("before", ()), ("after", (SLOW,))):
        assert tiny(tmp_path / name, *short, *more) == DONE
    assert compare(tmp_path / "before", tmp_path / "after", tmp_path / "out") == NOT_MET
    assert set(read(tmp_path / "out")["missions"]) <= {8, 16}
    (command, *_) = re.findall(r"replay in B: evoros (replay .*)", capsys.readouterr().out)
    assert evoros([*shlex.split(command), *TINY[:2]]) == DONE
    mixed = [str(tmp_path / "before"), str(top / "before")]
    told = refused(lambda: evoros_analyze(["regression", *mixed]), capsys)
    assert "regression: needs two evaluations or two runs, but found " in told


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"seed": 5}, r"config\.yaml: seed is 5, but 0 in .*before, so the random draws differ; "),
        ({"world.near.course.time_limit_s": 9.0}, r"world\.near\.course\.time_limit_s is 9"),
        ({"failure.count": 2}, r"failure\.count is 2, but 1 .* repeat one of the two with"),
        ({"evaluation_draws": "validation"}, "evaluation_draws is validation, but evaluation "),
    ],
)
def test_other_draws_are_refused(
    top: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    change: dict[str, object],
    told: str,
) -> None:
    other = vary(top / "before", tmp_path / "other", change)
    error = refused(lambda: compare(top / "before", other, tmp_path / "out"), capsys)
    assert re.search(told, error)
    assert not (tmp_path / "out").exists()


def test_what_cannot_be_compared_is_refused(
    top: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before, after = top / "before", top / "after"
    stopped = vary(before, tmp_path / "stopped", {}, {"state": "stopped"})
    for folders, more, told in (
        ([before], [], "needs two evaluations or two runs, but found before"),
        ([top], [], "needs two evaluations or two runs, but found after, before, same"),
        ([before, stopped], [], "no champion yet"),
        ([before, after], ["--margin=time_s=3"], "--margin time_s=3: must be completed=X or"),
        ([before, after], ["--margin=completed=-0.1"], "with X greater than 0 and less than 1"),
        ([before, after], ["--margin=completed"], "--margin completed: must be completed=X or"),
        ([before, after], ["--confidence=1"], "--confidence: must be greater than 0 and less"),
        ([before, after], ["--design=c"], "'c' is not a design in both folders; choose one"),
    ):
        words = ["regression", *map(str, folders), f"--output={tmp_path / 'out'}", *more]
        assert told in refused(partial(evoros_analyze, words), capsys)
    assert not (tmp_path / "out").exists()


def test_a_design_of_one_folder_is_left_out(
    top: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scored(tmp_path / "one", top / "one.csv", "trials=2")
    assert compare(top / "before", tmp_path / "one", tmp_path / "out") == DONE
    assert set(read(tmp_path / "out", "regression_missions")["design"]) == {"a"}
    assert "before: design b is in this folder only; left out" in capsys.readouterr().err
