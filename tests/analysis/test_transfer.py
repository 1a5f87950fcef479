"""The same designs under two conditions: which pairs are made, their numbers and their picture."""

import re
import shutil
import sys
from itertools import pairwise
from math import inf, isnan, nan, sqrt
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from fixture_types import Capture, Folders
from helpers import scored, texts, tiny
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.figure import Figure

from evoros.analysis.command import evoros_analyze
from evoros.analysis.figures.transfer import draw_ladder, draw_transfer, measure_bars, summarize
from evoros.analysis.statistics.small_samples import mean_interval
from evoros.analysis.tables.loading import load_study
from evoros.analysis.tables.pairs import climb, pair_scores
from evoros.analysis.tables.records import bound_scores
from evoros.base.errors import InputError
from evoros.terminal.console import DONE, INPUT

HEADER = "design,sensor,x_m,y_m,yaw_deg"
ANGLES = {"a": 0, "b": 20, "c": 40, "d": 60, "e": 80}


def test_bars_end_at_the_bounds_that_all_fitnesses_state() -> None:
    def score_within(*bounds: float) -> Any:
        return SimpleNamespace(context=SimpleNamespace(fitness=SimpleNamespace(bounds=bounds)))

    records = [score_within(0.0, 12.0), score_within(3.0, 24.0)]
    assert bound_scores(records) == (0.0, 24.0)
    assert bound_scores([*records, score_within()]) == bound_scores([]) == (-inf, inf)
    scores = np.array([[23.0, 6.0, 9.0], [1.0, 6.0, 9.0], [12.0, nan, 1.0]])
    assert measure_bars(scores, (0.0, 24.0)).tolist() == [[2.0, 1.0, 0.0], [1.0, 2.0, 0.0]]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: Folders) -> Path:
    """Five designs with spatial failures and with random ones; two trials each."""
    top = tmp_path_factory.mktemp("scores")
    rows = [f"{name},0,0.2,0.05,{angle}" for name, angle in ANGLES.items()]
    (top / "five.csv").write_text("\n".join([HEADER, *rows]))
    (top / "reversed.csv").write_text("\n".join([HEADER, *rows[::-1]]))
    scored(top / "spatial", top / "five.csv", "trials=2", "failure=spatial")
    scored(top / "random", top / "reversed.csv", "trials=2")
    return top


def pairs(*folders: Path, between: str | None = None) -> pd.DataFrame:
    result: pd.DataFrame = pair_scores(load_study(folders), between)
    return result


def fitness(folder: Path) -> dict[str, float]:
    table = pd.read_csv(folder / "designs.csv")
    return dict(zip(table["design"], table["fitness_mean"], strict=True))


# Which pairs ---------------------------------------------------------------------------------


@pytest.mark.slow
def test_designs_are_matched_by_what_they_are(folder: Path) -> None:
    table = pairs(folder / "spatial", folder / "random").set_index("design")
    spatial, random = fitness(folder / "spatial"), fitness(folder / "random")
    assert sorted(table.index) == sorted(ANGLES)
    for name, row in table.iterrows():
        assert (row["x_fitness"], row["y_fitness"]) == (spatial[str(name)], random[str(name)])
        assert row["change"] == row["y_fitness"] - row["x_fitness"]
        assert (row["x_trials"], row["y_trials"]) == (2, 2)
    assert set(table["between"]) == {"failure"}
    assert (set(table["x"]), set(table["y"])) == ({"spatial"}, {"random"})
    other = pairs(folder / "random", folder / "spatial").set_index("design")
    assert (set(other["x"]), set(other["y"])) == ({"random"}, {"spatial"})
    assert list(other["change"].sort_index()) == list(-table["change"].sort_index())


def test_designs_that_only_one_has_are_no_pairs(folder: Path, tmp_path: Path) -> None:
    rows = ["b,0,0.2,0.05,60", "z,0,0.2,0.05,61"]
    (tmp_path / "two.csv").write_text("\n".join([HEADER, *rows]))
    scored(tmp_path / "random", tmp_path / "two.csv", "trials=2")
    table = pairs(folder / "spatial", tmp_path / "random")
    assert list(table["design"]) == ["d"]  # that is what "b" is here
    (tmp_path / "two.csv").write_text("\n".join([HEADER, rows[1]]))
    scored(tmp_path / "other", tmp_path / "two.csv", "trials=2")
    with pytest.raises(InputError, match="no design has scores under two conditions"):
        pairs(folder / "spatial", tmp_path / "other")


@pytest.mark.slow
def test_evaluations_that_differ_in_several_parts_ask_for_one(
    folder: Path, tmp_path: Path, capsys: Capture
) -> None:
    """Then all pairs that differ in it alone share their axes; what else differs makes groups."""
    for failure in ("spatial", "random"):
        scored(
            tmp_path / failure,
            folder / "five.csv",
            *("trials=3", f"failure={failure}", "simulator.time_step=0.1"),
        )
    folders = [folder / "spatial", tmp_path / "random", folder / "random", tmp_path / "spatial"]
    arguments = ["transfer", *map(str, folders), "--output", str(tmp_path / "out")]
    capsys.readouterr()
    assert evoros_analyze(arguments) == INPUT
    said = capsys.readouterr().err
    assert "--between: the evaluations differ in failure, simulator" in said
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()
    for between, axes, groups in (
        ("failure", ("spatial", "random"), ("time step 0.05", "time step 0.1")),
        ("simulator", ("time step 0.05", "time step 0.1"), ("spatial", "random")),
    ):
        table = pairs(*folders, between=between)
        assert len(table) == 10
        assert (set(table["x"]), set(table["y"])) == ({axes[0]}, {axes[1]})
        assert set(table["group"]) == set(groups)
    assert evoros_analyze([*arguments, "--between", "world"]) == INPUT
    assert "but not in world" in capsys.readouterr().err


@pytest.mark.slow
def test_the_row_of_most_trials_stays(folder: Path, tmp_path: Path) -> None:
    scored(tmp_path / "more", folder / "five.csv", "trials=5", "failure=spatial")
    scored(tmp_path / "most", folder / "five.csv", "trials=4")
    table = pairs(folder / "spatial", folder / "random", tmp_path / "more", tmp_path / "most")
    assert len(table) == 5
    assert (set(table["x_trials"]), set(table["y_trials"])) == ({5}, {4})


@pytest.mark.slow
def test_two_evaluations_are_a_pair_whatever_they_differ_in(folder: Path, tmp_path: Path) -> None:
    more = ("trials=2", "failure=spatial", "simulator.time_step=0.1")
    scored(tmp_path / "both", folder / "five.csv", *more)
    assert set(pairs(folder / "random", tmp_path / "both")["between"]) == {"failure and simulator"}
    scored(tmp_path / "again", folder / "five.csv", "trials=2", "failure=spatial", "seed=3")
    table = pairs(folder / "spatial", tmp_path / "again")
    row = table.iloc[0]
    assert (row["between"], row["x"], row["y"]) == ("draws", "spatial", "again")


@pytest.mark.slow
def test_champions_are_grouped_by_the_treatment_of_their_runs(tmp_path: Path) -> None:
    stuck = "filter@failure.effect=stuck"
    assert tiny(tmp_path / "runs/silent", "optimizer.generations=1", "seed=3") == DONE
    assert tiny(tmp_path / "runs/stuck", "optimizer.generations=1", "seed=4", stuck) == DONE
    for failure in ("spatial", "random"):
        scored(tmp_path / failure, tmp_path / "runs", f"failure={failure}")
    assert sorted(pairs(tmp_path)["group"]) == ["silence", "stuck"]
    assert set(pairs(tmp_path / "spatial", tmp_path / "random")["group"]) == {""}


def test_a_run_with_a_confirmation_has_its_confirmed_designs(tmp_path: Path) -> None:
    small = ("optimizer.population_size=6", "optimizer.generations=2")
    assert tiny(tmp_path / "run", "confirmation=strict", *small) == DONE
    table = pairs(tmp_path)
    files = sorted((tmp_path / "run" / "generations").iterdir())
    recorded = pd.concat([pd.read_csv(file) for file in files]).drop_duplicates("id")
    recorded = recorded[recorded["loss"].notna()].set_index("id")
    assert sorted(table["design"]) == sorted(recorded.index)
    part = recorded.loc[table["design"]]
    assert list(table["x_fitness"]) == list(part["screened_fitness"])
    assert list(table["change"]) == pytest.approx(list(-part["loss"]))
    assert table["x_sd"].isna().all()
    assert set(table["between"]) == {"simulator"}


def test_runs_alone_are_one_clear_line(folder: Path, tmp_path: Path, capsys: Capture) -> None:
    shutil.copytree(folder / "random", tmp_path / "unfinished")
    (tmp_path / "unfinished" / "designs.csv").unlink()
    folders = [str(folder / "spatial"), str(tmp_path / "unfinished")]
    assert evoros_analyze(["transfer", *folders, "--output", str(tmp_path / "out")]) == INPUT
    warning, error = capsys.readouterr().err.splitlines()
    assert warning.endswith("left out")
    assert "give two finished evaluations of the same designs" in error


# Controllers, and the ladder -------------------------------------------------------------------


PROGRAM = """
import json, os
lines = os.fdopen(int(os.environ["EVOROS_IN"]))
answers = os.fdopen(int(os.environ["EVOROS_OUT"]), "w")
lines.readline()
answer = {"ready": True}
while True:
    print(json.dumps(answer), file=answers, flush=True)
    line = lines.readline()
    if not line:
        break
    *_, readings = json.loads(line)
    answer = [1, 0.1 + 0.05 * sum(reading or 0.0 for reading in readings), 0.0]
"""


@pytest.fixture(scope="module")
def rungs(folder: Path, tmp_path_factory: Folders) -> list[Path]:
    """Five designs: with the rover's rules, with a program outside, and with other failures."""
    top = tmp_path_factory.mktemp("rungs")
    (top / "drive.py").write_text(PROGRAM)
    parts = ("controller=program", f"controller.command=[{sys.executable},{top}/drive.py]")
    return [
        folder / "random",
        scored(top / "middle", folder / "reversed.csv", *parts),
        folder / "spatial",
    ]


@pytest.mark.slow
def test_evaluations_are_told_apart_by_controller(rungs: list[Path]) -> None:
    table = pairs(*rungs[:2])
    assert set(table["between"]) == {"controller"}
    assert (set(table["x"]), set(table["y"])) == ({"rover"}, {"program"})
    low, middle = map(fitness, rungs[:2])
    for _, row in table.iterrows():
        assert (row["x_fitness"], row["y_fitness"]) == (low[row["design"]], middle[row["design"]])
    assert low != middle


def test_each_rung_is_compared_with_the_next(rungs: list[Path]) -> None:
    for order in (rungs, rungs[::-1]):
        table = climb(load_study(order))
        assert len(table) == 2 * len(ANGLES)
        for (lower, upper), (_, step) in zip(
            pairwise(order), table.groupby(["x", "y"], sort=False), strict=True
        ):
            names = step["design"].tolist()
            assert sorted(names) == sorted(ANGLES)
            assert step["x_fitness"].tolist() == [fitness(lower)[name] for name in names]
            assert step["y_fitness"].tolist() == [fitness(upper)[name] for name in names]
            assert step["change"].tolist() == (step["y_fitness"] - step["x_fitness"]).tolist()
    between = [set(parts.split(" and ")) for parts in table["between"].unique()]
    assert between == [{"controller", "failure"}, {"controller"}]
    labels = list(dict.fromkeys([*table["x"], *table["y"]]))
    assert [set(label.split(", ")) for label in labels] == [
        {"rover", "spatial"},
        {"program", "random"},
        {"rover", "random"},
    ]
    assert table["source"].nunique() == 1  # a design has one name on all rungs


def test_the_command_draws_the_ladder(rungs: list[Path], tmp_path: Path, capsys: Capture) -> None:
    chosen = ["--ladder", "--format", "svg", "--output", str(tmp_path)]
    assert evoros_analyze(["transfer", *map(str, rungs), *chosen]) == DONE
    said = capsys.readouterr().out.splitlines()
    assert "5 designs: ranking" in said[0]
    (_, end), (begin, _) = (re.findall('"([^"]+)"', line) for line in said[:2])
    assert begin == end  # each step begins where the last has ended
    assert len(pd.read_csv(tmp_path / "transfer.csv")) == 10
    assert len(pd.read_csv(tmp_path / "transfer_summary.csv")) == 2


def test_a_ladder_needs_two_rungs_with_the_same_designs(
    rungs: list[Path], tmp_path: Path, capsys: Capture
) -> None:
    (tmp_path / "other.csv").write_text(f"{HEADER}\nz,0,0.2,0.05,61")
    other = scored(tmp_path / "other", tmp_path / "other.csv")
    for given, problem in (([rungs[0]], "two or more"), ([rungs[0], other], "no design")):
        capsys.readouterr()
        arguments = ["transfer", "--ladder", f"--output={tmp_path / 'out'}", *map(str, given)]
        assert evoros_analyze(arguments) == INPUT
        err = capsys.readouterr().err
        assert err.count("\n") == 1
        assert err.startswith("evoros analyze: --ladder: ")
        assert problem in err


def test_lines_and_bars_of_a_ladder_are_those_of_its_table(rungs: list[Path]) -> None:
    table = climb(load_study(rungs))
    figure = draw_ladder(table, summarize(table))
    (axes,) = figure.axes
    bars: Any = axes.containers
    shown = [np.asarray(item.lines[0].get_ydata()).tolist() for item in bars]
    expected = [
        [step["x_fitness"].iloc[0], *step["y_fitness"]]
        for _, step in table.groupby(["source", "design"], sort=False)
    ]
    assert shown == expected
    (mean,) = (line for line in axes.get_lines() if line.get_label() == "mean")
    np.testing.assert_allclose(np.asarray(mean.get_ydata()), np.mean(expected, axis=0))
    rungs_drawn = [label.get_text() for label in axes.get_xticklabels()]
    assert rungs_drawn == [
        table["x"].iloc[0].replace(", ", "\n"),
        *(y.replace(", ", "\n") for y in table["y"].unique()),
    ]


# The numbers ---------------------------------------------------------------------------------

X, Y = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [2.0, 1.0, 3.5, 3.0, 5.0, 5.5]


def table_of(xs: list[float], ys: list[float], group: str = "", **other: object) -> pd.DataFrame:
    rest = {"x_sd": 0.4, "y_sd": 0.8, "x_trials": 4, "y_trials": 16}
    names = {"between": "failure", "x": "none", "y": "random", "group": group}
    numbers = {"x_fitness": xs, "y_fitness": ys, "change": np.subtract(ys, xs)}
    return pd.DataFrame({**numbers, **names, **rest, **other})


def test_the_summary_by_hand() -> None:
    """Ranks 2 1 4 3 5 6 against 1 ... 6: 1 - 6 * 4 / (6 * 35); the losses add up to 1."""
    (row,) = summarize(table_of(X, Y)).to_dict("records")
    assert row["n"] == 6
    assert row["spearman"] == pytest.approx(1 - 24 / 210)
    assert row["change"] == pytest.approx(-1 / 6)
    change = mean_interval(np.subtract(Y, X))
    assert isnan(row["spearman_low"])  # of fewer than ten
    assert (row["change_low"], row["change_high"]) == (change.low, change.high)


def test_groups_are_summed_up_apart() -> None:
    two = pd.concat([table_of(X, Y, "b"), table_of(X, X[::-1], "a")], ignore_index=True)
    result = summarize(two).set_index("group")
    assert list(result.index) == ["b", "a"]
    assert result.loc["a", "spearman"] == pytest.approx(-1)
    assert result.loc["b", "spearman"] == pytest.approx(1 - 24 / 210)


def test_the_command_writes_table_summary_and_picture(
    folder: Path, tmp_path: Path, capsys: Capture
) -> None:
    output = ["--output", str(tmp_path / "one"), "--format", "svg"]
    assert evoros_analyze(["transfer", str(folder), *output]) == DONE
    said = capsys.readouterr().out.splitlines()[0]
    assert said.startswith('"random" to "spatial": 5 designs: ranking ')
    names = {"transfer.svg", "transfer.csv", "transfer_summary.csv"}
    assert {path.name for path in (tmp_path / "one").iterdir()} == names
    written = pd.read_csv(tmp_path / "one" / "transfer_summary.csv")
    assert written["change"].item() == pytest.approx(pairs(folder)["change"].mean())


# The picture ---------------------------------------------------------------------------------


def drawn(table: pd.DataFrame, width: float = 3.5) -> Figure:
    figure: Figure = draw_transfer(table, summarize(table), width)
    return figure


def test_dots_bars_and_the_line_are_those_of_the_table() -> None:
    (axes,) = drawn(table_of(X, Y)).axes
    (dots,) = (item for item in axes.collections if isinstance(item, PathCollection))
    assert np.asarray(dots.get_offsets()).tolist() == [
        list(pair) for pair in zip(X, Y, strict=True)
    ]
    bars = [item for item in axes.collections if isinstance(item, LineCollection)]
    spans = [np.ptp(bar.get_segments()[0], axis=0).max() for bar in bars]
    assert sorted(spans) == pytest.approx([2 * 0.4 / sqrt(4), 2 * 0.8 / sqrt(16)])
    (line,) = (entry for entry in axes.get_lines() if entry.get_linestyle() != "None")
    ends = np.asarray(line.get_xydata())
    assert ends[:, 0].tolist() == ends[:, 1].tolist() == list(axes.get_xlim())
    assert axes.get_xlim() == axes.get_ylim()
    assert (axes.get_xlabel(), axes.get_ylabel()) == (
        "fitness, failure: none",
        "fitness, failure: random",
    )


def test_without_trials_there_are_no_bars() -> None:
    (axes,) = drawn(table_of(X, Y, x_sd=nan, y_sd=nan)).axes
    bars = [item for item in axes.collections if isinstance(item, LineCollection)]
    assert all(np.ptp(part, axis=0).max() == 0 for bar in bars for part in bar.get_segments())


def test_the_summary_stands_below_and_too_few_are_marked() -> None:
    there = {text.get_text() for text in texts(drawn(table_of(X, Y)))}
    one = summarize(table_of(X, Y)).iloc[0]
    order = f"{one['spearman']:.2f}"
    assert {"6", "all", order} <= there
    few = {text.get_text() for text in texts(drawn(table_of(X[:4], Y[:4])))}
    assert {"all*", "*too few designs for a conclusion: 5 or more are needed"} <= few
