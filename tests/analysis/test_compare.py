"""Champions are validated by what flew under their conditions; treatments are compared by it."""

import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from math import nan
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml
from fixture_types import Capture, Folders, Log
from helpers import reseal, scored, texts, tiny
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from evoros.analysis.command import evoros_analyze
from evoros.analysis.figures.compare import _report_conditions, draw_comparison
from evoros.analysis.statistics.comparison import compare_treatments, conclude
from evoros.analysis.statistics.small_samples import holm, median_interval
from evoros.analysis.statistics.two_samples import a12_interval, brunner_munzel
from evoros.analysis.tables.loading import load_study
from evoros.analysis.tables.validated import (
    identify_champion,
    list_differences,
    list_unused,
    validate_champions,
)
from evoros.terminal.console import DONE, INPUT


@pytest.fixture(scope="module")
def study(tmp_path_factory: Folders) -> Path:
    """Two treatments of two seeds, and all champions scored under the conditions of one."""
    folder = tmp_path_factory.mktemp("study")
    for seed in (1, 2):
        for name, more in (("silent", ()), ("stuck", ("filter@failure.effect=stuck",))):
            run = folder / "runs" / f"{name}_seed-{seed}"
            assert tiny(run, f"seed={seed}", "optimizer.generations=1", *more) == DONE
    scored(folder / "silent", folder / "runs", "trials=3")
    return folder


@pytest.fixture
def copied(study: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(study, tmp_path / "elsewhere"))


def table(*folders: Path) -> pd.DataFrame:
    scores: pd.DataFrame = validate_champions(load_study(folders)).set_index("run")
    return scores


# Which evaluation validates which run --------------------------------------------------------


@pytest.mark.slow
def test_a_champion_is_validated_under_the_conditions_of_its_run_and_no_others(study: Path) -> None:
    runs = table(study)
    fresh = pd.read_csv(study / "silent" / "designs.csv")
    for name, row in runs.iterrows():
        status = json.loads((study / "runs" / str(name) / "status.json").read_text())
        assert row["recorded"] == status["best_fitness"]
        assert row["in_run"] == status["best_validated_fitness"]
        if str(name).startswith("silent"):
            part = fresh[fresh["source"].str.endswith(str(name))].iloc[0]
            assert (row["validated"], row["fresh_sd"]) == (part["fitness_mean"], part["fitness_sd"])
            assert (row["validated_by"], row["evaluation"]) == ("evaluation", "silent")
            assert row["fresh_trials"] == 3
        else:
            assert (row["validated"], row["validated_by"]) == (row["in_run"], "run")
            assert np.isnan(row["fresh"])


def test_a_champion_is_validated_by_what_the_fitness_makes_of_its_trials(copied: Path) -> None:
    """Such as the mean of the lowest, in a column of its own."""
    file = copied / "silent" / "designs.csv"
    scores = pd.read_csv(file)
    scores.insert(2, "fitness", scores["fitness_mean"] - 1.5)
    scores.to_csv(file, index=False)
    reseal(copied / "silent")
    runs = table(copied)
    fresh = runs[runs["validated_by"] == "evaluation"]
    part = scores[scores["source"].str.contains("silent")]
    assert sorted(fresh["validated"]) == sorted(part["fitness"])


@pytest.mark.parametrize(
    ("field", "value", "told"),
    [
        ("commit", "0123abcd", "used commit 0123abcd"),
        ("dirty", "other", "and changed files"),
        ("packages", {"numpy": "1.2.3"}, "numpy 1.2.3"),
        ("platform", "another machine", ""),  # by which missions do not change
    ],
)
def test_runs_by_different_versions_are_told(
    copied: Path, field: str, value: object, told: str, caplog: Log
) -> None:
    load_study([copied])
    assert "different versions" not in caplog.text
    file = copied / "runs" / "silent_seed-1" / "manifest.json"
    manifest = json.loads(file.read_text())
    if value == "other":
        value = not manifest[field]
    manifest[field] = manifest[field] | value if isinstance(value, dict) else value
    file.write_text(json.dumps(manifest))
    reseal(file.parent)
    load_study([copied])
    warned = [line for line in caplog.messages if "different versions" in line]
    assert len(warned) == bool(told)
    assert all("silent_seed-1" in line and told in line for line in warned)


@pytest.mark.slow
def test_of_several_evaluations_that_with_most_trials_counts(copied: Path) -> None:
    scored(copied / "a", copied / "runs", "trials=4", "seed=5", "optimizer.generations=9")
    scored(copied / "z", copied / "runs", "trials=2")
    row = table(copied).loc["silent_seed-1"]
    assert (row["evaluation"], row["fresh_trials"]) == ("a", 4)


EDITS: list[tuple[str, Any, bool]] = [
    ("seed", 99, True),
    ("trials", 99, True),
    ("lost_missions", "worst", True),
    ("executor.workers", 7, True),
    ("optimizer.generations", 99, True),
    ("design.number", 2, True),  # which designs there can be; this one is given
    ("figures", ["fitness"], True),
    ("failure.earliest_s", 1.0, False),
    ("failure.effect._target_", "evoros.filter.stuck.Stuck", False),
    ("simulator.time_step", 0.07, False),
    ("controller.avoidance.range_m", 1.0, False),
    ("design.sensors.sonar.range_max_m", 3.0, False),
    ("world.near.course.time_limit_s", 10.0, False),
    ("world.third.sdf", "maze.sdf", False),
    ("robot.mount.z_m", 0.2, False),
    ("fitness.sensor_penalty", 1.0, False),
]


def test_all_that_a_mission_consists_of_must_agree(study: Path) -> None:
    scores = load_study([study])
    (evaluation,) = scores.evaluations
    (record,) = (item for item in scores.records if item.name == "silent_seed-1")
    for key, value, same in EDITS:
        edited = replace(evaluation, values={**evaluation.values, key: value})
        assert edited.values != evaluation.values
        assert (not list_differences(edited, record)) is same, key


@pytest.mark.parametrize("column", ["yaw_deg", "link"])
def test_designs_that_differ_a_little_are_others(column: str, copied: Path) -> None:
    file = copied / "silent" / "designs_in.csv"
    given = pd.read_csv(file)
    given[column] = "lidar" if column == "link" else np.nextafter(given[column], 1000.0)
    given.to_csv(file, index=False)
    reseal(file.parent)
    assert set(table(copied)["validated_by"]) == {"run"}


@pytest.mark.slow
def test_other_evolved_values_belong_to_the_design(tmp_path: Path) -> None:
    key = "controller.avoidance.range_m"
    gene = f"{{_target_: evoros.design.genes.Gene, key: {key}, low: 1, high: 2}}"
    run = tmp_path / "run"
    assert tiny(run, f"+design.genes.reach={gene}", "optimizer.generations=1") == DONE
    scored(tmp_path / "again", run, "trials=2", f"{key}=1.25")
    assert table(tmp_path)["validated_by"].item() == "evaluation"
    file = tmp_path / "again" / "genes_in.csv"
    genes = pd.read_csv(file)
    genes.assign(value=genes["value"] + 0.01).to_csv(file, index=False)
    reseal(file.parent)
    assert table(tmp_path)["validated_by"].item() == "run"


@pytest.mark.slow
def test_a_confirmed_run_is_validated_in_the_confirming_simulator(tmp_path: Path) -> None:
    small = ("optimizer.population_size=4", "optimizer.generations=1")
    assert tiny(tmp_path / "run", "confirmation=strict", *small) == DONE
    scored(tmp_path / "own", tmp_path / "run", "trials=2")
    assert table(tmp_path)["validated_by"].item() == "run"
    config = yaml.safe_load((tmp_path / "run" / "config.yaml").read_text())
    simulator = {**config["confirmation"]["simulator"]}
    file = tmp_path / "own" / "config.yaml"
    confirming = yaml.safe_load(file.read_text()) | {"simulator": simulator}
    file.write_text(yaml.safe_dump(confirming))
    reseal(file.parent)
    assert table(tmp_path)["validated_by"].item() == "evaluation"


def test_a_champion_without_sensors_is_a_design_too(copied: Path) -> None:
    name = "runs/silent_seed-1"
    header, row, *_ = (copied / name / "champion/design.csv").read_text().splitlines()
    bare = row.partition(",")[0] + "," * header.count(",")
    (copied / name / "champion/design.csv").write_text(f"{header}\n{bare}\n")
    reseal(copied / name)
    (copied / "runs").rename(copied / "bare")
    shutil.rmtree(copied / "silent")
    scored(copied / "silent", copied / "bare", "trials=2")
    study = load_study([copied])
    assert identify_champion(study.records[0]) == ((), ())
    assert table(copied).loc["silent_seed-1", "validated_by"] == "evaluation"


def test_all_champions_can_be_compared_under_the_same_conditions(
    study: Path, tmp_path: Path, capsys: Capture
) -> None:
    arguments = ["compare", str(study), "--output", str(tmp_path / "out"), "--format", "svg"]
    assert evoros_analyze(arguments) == DONE
    assert "the runs differ in failure, and each was scored under its own" in (
        capsys.readouterr().out
    )
    assert evoros_analyze([*arguments, "--under", "silent"]) == DONE
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "fitness (Eq. 1) under silent is known for 4 of 4 champions"
    assert said[1].startswith('fitness (Eq. 1) under silent, "silence" versus "stuck": too few')
    fresh = pd.read_csv(study / "silent" / "designs.csv")
    means = dict(zip(fresh["source"], fresh["fitness_mean"], strict=True))
    runs = pd.read_csv(tmp_path / "out" / "compare_runs.csv")
    for run, value in zip(runs["run"], runs["under silent"], strict=True):
        assert value == means[str(study / "runs" / run)]
    assert evoros_analyze([*arguments, "--under", "nothing"]) == INPUT
    assert "is not the label or name of a finished evaluation" in capsys.readouterr().err


@pytest.mark.slow
def test_an_evaluation_that_validates_no_run_is_told_with_what_it_differs_in(
    study: Path, copied: Path, capsys: Capture
) -> None:
    assert list_unused(load_study([study])) == {}  # some runs suffice
    scored(copied / "a fast one", copied / "runs", "simulator.time_step=0.1")
    assert list_unused(load_study([copied])) == {"a fast one": ["simulator"]}
    output = ["--output", str(copied / "out"), "--format", "svg"]
    assert evoros_analyze(["compare", str(copied), *output]) == DONE
    out = capsys.readouterr().out.splitlines()
    (line,) = (item for item in out if item.startswith("a fast one validates no run, "))
    assert "because it and the runs differ in simulator; --under 'a fast one' compares" in line


def test_an_evaluation_of_none_of_the_champions_compares_nothing(
    study: Path, tmp_path: Path, capsys: Capture
) -> None:
    (tmp_path / "one.csv").write_text("design,sensor,x_m,y_m,yaw_deg\na,0,0.2,0.05,7\n")
    scored(tmp_path / "else", tmp_path / "one.csv")
    capsys.readouterr()
    folders = [str(study / "runs"), str(tmp_path / "else"), "--output", str(tmp_path / "out")]
    assert evoros_analyze(["compare", *folders, "--under", "else"]) == INPUT
    err = capsys.readouterr().err
    assert "--under else: the evaluation contains no champion of these runs" in err
    assert err.count("\n") == 1


def test_what_is_unfinished_or_damaged_is_left_out_in_one_line(
    copied: Path, capsys: Capture
) -> None:
    (copied / "silent" / "designs.csv").unlink()
    status = json.loads((copied / "runs/stuck_seed-1/status.json").read_text())
    stopped = json.dumps(status | {"state": "stopped"})
    (copied / "runs/stuck_seed-1/status.json").write_text(stopped)
    (copied / "runs/stuck_seed-2/champion/design.csv").write_text("design,sensor\n1,one\n")
    for name in ("1", "2"):
        reseal(copied / f"runs/stuck_seed-{name}")
    arguments = ["compare", str(copied), "--output", str(copied / "out"), "--format", "svg"]
    assert evoros_analyze(arguments) == DONE
    out, err = capsys.readouterr()
    assert [line.endswith("left out") for line in err.splitlines()] == [True] * 3
    for name in ("silent/designs.csv", "stuck_seed-1: no champion yet", "stuck_seed-2/champion"):
        assert name in err
    assert "2 of 2 runs: from the runs themselves, 1 trial\n" in out
    assert "evoros evaluate like=SWEEP" in out


def test_no_finished_run_is_one_clear_line(study: Path, tmp_path: Path, capsys: Capture) -> None:
    output = ["--output", str(tmp_path / "out")]
    assert evoros_analyze(["compare", str(study / "silent"), *output]) == INPUT
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "out").exists()


# What is compared ----------------------------------------------------------------------------

FIVE = {"low": [1.0, 2.0, 3.0, 4.0, 5.0], "high": [6.0, 7.0, 8.0, 9.0, 10.0], "mid": [4.5] * 5}


def runs_of(values: dict[str, list[float]], validated: float = 0.0) -> pd.DataFrame:
    rows = [(name, value, value - validated) for name, some in values.items() for value in some]
    return pd.DataFrame(rows, columns=["treatment", "recorded", "validated"])


def test_the_comparisons_are_those_of_the_statistics() -> None:
    scores = compare_treatments(runs_of(FIVE, 0.5))
    assert list(scores["measure"]) == ["recorded"] * 3 + ["validated"] * 3
    assert list(zip(scores["a"], scores["b"], strict=True))[:3] == list(combinations(FIVE, 2))
    first = scores.iloc[0]
    assert first["p"] == pytest.approx(2 / 252)  # the least of C(10, 5) splits, twice
    assert first["a12"] == 0.0
    assert (first["n_a"], first["median_a"], first["median_b"]) == (5, 3.0, 8.0)
    middle = median_interval(FIVE["low"])
    assert (first["median_low_a"], first["median_high_a"]) == (middle.low, middle.high)
    p = [brunner_munzel(FIVE[a], FIVE[b]) for a, b in combinations(FIVE, 2)]
    assert list(scores["p_holm"])[:3] == holm(p)
    assert scores["least_p_holm"].to_numpy() == pytest.approx(3 * 2 / 252)
    later = scores.iloc[3:].reset_index(drop=True)
    assert later[["p", "p_holm", "a12"]].equals(scores.iloc[:3][["p", "p_holm", "a12"]])
    assert list(later["median_a"]) == [2.5, 2.5, 7.5]


def test_each_conclusion_is_one_plain_sentence() -> None:
    said = conclude(compare_treatments(runs_of(FIVE)))[:3]
    high = a12_interval(FIVE["low"], FIVE["high"]).high
    assert said[0] == (
        'recorded fitness, "low" versus "high": "high" is higher: p = 0.024 '
        f"(permuted Brunner-Munzel test, Holm), A12 = 0.00 [0.00, {high:.2f}] (95 % interval)"
    )
    assert '"low" versus "mid": no significant difference at the 5 % level: p = ' in said[1]
    assert '"high" versus "mid": "high" is higher' in said[2]


def test_too_few_replicates_are_said() -> None:
    few = {name: values[:3] for name, values in FIVE.items()}
    said = conclude(compare_treatments(runs_of(few)))
    assert [line.partition(":")[0] for line in said] == [
        f"{kind} fitness, 3 pairs" for kind in ("recorded", "validated")
    ]
    asks = (
        "too few replicates (3) for any conclusion: each treatment needs at least 5; type: evoros"
    )
    assert all(f"{asks} -m ... 'seed=range(5)'" in line for line in said)
    two = {name: values[:4] for name, values in list(FIVE.items())[:2]}
    (four, _) = conclude(compare_treatments(runs_of(two)))
    assert "too few replicates (4)" in four
    uneven = {"low": FIVE["low"] * 2, "high": FIVE["high"][:1]}
    said = conclude(compare_treatments(runs_of(uneven)))
    assert "too few replicates (1 to 10)" in said[0]


def test_one_treatment_has_its_interval_and_nothing_to_compare() -> None:
    scores = compare_treatments(runs_of({"low": FIVE["low"]}))
    assert list(scores["b"]) == ["", ""]
    assert (scores["median_a"][0], scores["n_a"][0]) == (3.0, 5)
    assert scores[["p", "a12", "median_b"]].isna().all().all()
    assert all("nothing to compare" in line for line in conclude(scores))


def test_runs_without_a_validation_have_none_compared() -> None:
    runs = runs_of(FIVE)
    runs.loc[runs["treatment"] == "mid", "validated"] = nan
    scores = compare_treatments(runs)
    assert [(row.a, row.b) for row in scores[scores["measure"] == "validated"].itertuples()] == [
        ("low", "high")
    ]


def test_designs_are_compared_and_are_no_condition() -> None:
    def report(key: str) -> list[str]:
        records = [SimpleNamespace(values={key: level}) for level in ("sonar", "lidar")]
        return list(_report_conditions(SimpleNamespace(records=records)))  # type: ignore[arg-type]

    assert report("design.sensors.0.type") == []
    assert "the runs differ in controller" in report("controller.speed_mps")[0]


# The picture ---------------------------------------------------------------------------------


def drawn(runs: pd.DataFrame, width: float = 3.5) -> Figure:
    figure: Figure = draw_comparison(runs, compare_treatments(runs), width)
    return figure


def dots(axes: Axes) -> Iterator[tuple[list[float], list[float]]]:
    for item in axes.collections:
        if isinstance(item, PathCollection):
            places = np.asarray(item.get_offsets())
            yield sorted(places[:, 0]), list(places[:, 1])


def test_every_run_is_a_dot_in_the_row_of_its_treatment() -> None:
    figure = drawn(runs_of(FIVE, 0.5))
    assert [axes.get_xlabel() for axes in figure.axes] == ["recorded fitness", "validated fitness"]
    for axes, less in zip(figure.axes, (0.0, 0.5), strict=True):
        for row, ((values, places), some) in enumerate(zip(dots(axes), FIVE.values(), strict=True)):
            assert values == [value - less for value in sorted(some)]
            assert all(row < y < row + 0.5 for y in places)
        assert [tick.get_text() for tick in axes.get_yticklabels()] == list(FIVE)


def test_boxes_are_quartiles_and_whiskers_end_within_one_and_a_half_of_them() -> None:
    """1 ... 5 and 30 have the quartiles 2.25 and 4.75, so that 30 lies beyond."""
    (axes, _) = drawn(runs_of({"one": [*FIVE["low"], 30.0]})).axes
    (box,) = (patch for patch in axes.patches if isinstance(patch, Rectangle))
    assert (box.get_x(), box.get_x() + box.get_width()) == (2.25, 4.75)
    lines = [item for item in axes.collections if isinstance(item, LineCollection)]
    ends = [tuple(segment[:, 0]) for line in lines for segment in line.get_segments()]
    assert ends == [(1.0, 2.25), (4.75, 5.0), (3.5, 3.5)]


@pytest.mark.parametrize("width", [3.5, 7.0])
def test_the_numbers_of_the_table_stand_in_the_picture(width: float) -> None:
    runs = runs_of(FIVE, 0.25)
    there = [text.get_text() for text in texts(drawn(runs, width))]
    for row in compare_treatments(runs).itertuples():
        effect = f"{row.a12:.2f} [{row.a12_low:.2f}, {row.a12_high:.2f}]"
        assert {f"{row.a} vs {row.b}", f"{row.p_holm:.3f}", effect} <= set(there)
        side = f"{row.median_a:.2f}, n = 5\n[{row.median_low_a:.2f}, {row.median_high_a:.2f}; 94 %]"
        assert side in there
    assert drawn(runs, width).get_figwidth() == width


LONG = {
    "none, population_size=30, number=[1, 2]": FIVE["low"][:3],
    "random, population_size=100, mirrored=false": FIVE["high"],
    "spatial": FIVE["mid"],
}


def test_long_names_get_letters_and_too_few_a_mark() -> None:
    there = [text.get_text() for text in texts(drawn(runs_of(LONG)))]
    assert {"A vs B*", "A vs C*", "B vs C"} <= set(there)
    assert any("*too few" in text and ": 5 each" in text for text in there)


@pytest.mark.slow
def test_very_many_comparisons_are_left_to_the_table() -> None:
    many = {f"t{i}": FIVE["low"] for i in range(9)}
    figure = drawn(runs_of(many))
    assert not any(" vs " in text.get_text() for text in texts(figure))
    assert len(compare_treatments(runs_of(many))) == 2 * 36


def test_without_any_validation_there_is_one_panel() -> None:
    figure = drawn(runs_of(FIVE).assign(validated=nan))
    assert [axes.get_xlabel() for axes in figure.axes] == ["recorded fitness"]
