"""Whole runs in some folders are found, and each other folder is reported in a line."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from fixture_types import Capture, Folders, Log, Patch
from helpers import TINY, everything, reseal, tiny, vary
from hypothesis import given
from hypothesis import strategies as st

from evoros.analysis.command import evoros_analyze
from evoros.analysis.subcommands import SUBCOMMANDS
from evoros.analysis.tables.factors import name_part, read_choices
from evoros.analysis.tables.loading import find_folders, load_study, shorten_names
from evoros.analysis.tables.records import read_values
from evoros.analysis.tables.treatments import SINGLE, label_treatments
from evoros.base.errors import InputError
from evoros.cli.command import evaluate
from evoros.terminal.console import DONE, INPUT


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: Folders) -> Path:
    """Two treatments of two seeds, and an evaluation of one champion."""
    folder = tmp_path_factory.mktemp("sweep")
    for failure, more in (("silent", ()), ("stuck", ("filter@failure.effect=stuck",))):
        run = folder / f"{failure}_seed-2"
        assert tiny(run, "seed=2", "optimizer.generations=2", *more) == DONE
        better = {"best_validated_fitness": 1e3 + len(failure)}
        vary(run, folder / f"{failure}_seed-10", {"seed": 10}, better)
    arguments = [*TINY, "executor=serial", f"designs={folder / 'stuck_seed-2'}"]
    assert evaluate([*arguments, f"hydra.run.dir={folder / 'again'}"]) == DONE
    return folder


@pytest.mark.slow
def test_runs_and_evaluations_of_a_sweep_are_found_in_order(sweep: Path) -> None:
    study = load_study([sweep])
    names = ["silent_seed-2", "silent_seed-10", "stuck_seed-2", "stuck_seed-10"]
    assert [record.name for record in study.records] == names
    assert [record.treatment for record in study.records] == ["silence"] * 2 + ["stuck"] * 2
    assert [record.seed for record in study.records] == [2, 10, 2, 10]
    assert [configurations.name for configurations in study.evaluations] == ["again"]
    assert list(study.generations.columns[:3]) == ["run", "treatment", "seed"]
    assert study.ranked[0].run.status["best_validated_fitness"] == max(
        record.run.status["best_validated_fitness"] for record in study.records
    )


def test_a_folder_counts_once_however_it_is_given(
    sweep: Path, tmp_path: Path, monkeypatch: Patch
) -> None:
    first = sweep / "stuck_seed-2"
    (tmp_path / "link").symlink_to(sweep)
    monkeypatch.chdir(sweep.parent)
    study = load_study([first, sweep, first, Path(sweep.name), tmp_path / "link"])
    assert len(study.records) == 4
    assert len(study.evaluations) == 1
    assert study.records[0].path == first


@pytest.mark.parametrize("figure", sorted(SUBCOMMANDS.keys() & {"mission", "bag"}))
def test_an_evaluation_without_trajectories_is_told_what_keeps_them(
    figure: str, sweep: Path, capsys: Capture
) -> None:
    assert evoros_analyze([figure, str(sweep / "again"), "--world", "near"]) == INPUT
    assert "no trajectory of a mission was kept; evaluate with" in capsys.readouterr().err


def test_a_dollar_in_a_name_is_no_formula(sweep: Path, tmp_path: Path) -> None:
    shutil.copytree(sweep, tmp_path / "sweep")
    for seed in (2, 10):
        config = tmp_path / "sweep" / f"stuck_seed-{seed}" / "config.yaml"
        config.write_text(f"{config.read_text()}\nnote: $^{{$\n")
        reseal(config.parent)
    for name in ("fitness", "compare"):  # all figures have one style, which decides this
        given = [name, str(tmp_path / "sweep"), "--output", str(tmp_path / "out")]
        assert evoros_analyze([*given, "--format", "svg"]) == DONE
    assert "note $^{$" in (tmp_path / "out" / "compare.csv").read_text()


DAMAGES: dict[str, Callable[[Path], object]] = {
    "no manifest": lambda run: (run / "manifest.json").unlink(),
    "no setting": lambda run: (run / "setting.json").unlink(),
    "setting cut": lambda run: (run / "setting.json").write_text("{"),
    "status cut": lambda run: (run / "status.json").write_text('{"state": "fini'),
    "status a list": lambda run: (run / "status.json").write_text("[]"),
    "config no YAML": lambda run: (run / "config.yaml").write_text("a: [b"),
    "config no mapping": lambda run: (run / "config.yaml").write_text("- a"),
    "config without seed": lambda run: (run / "config.yaml").write_text("a: 1"),
    "generation cut": lambda run: _cut(run / "generations/00001.csv", 200),
    "generation empty": lambda run: (run / "generations/00001.csv").write_text(""),
    "generation binary": lambda run: (run / "generations/00001.csv").write_bytes(b"\xff\x00"),
    "word for a number": lambda run: _swap(run / "generations/00001.csv", "fitness", "good"),
    "no column": lambda run: _swap(run / "generations/00001.csv", "fitness", None),
    "no generations": lambda run: shutil.rmtree(run / "generations"),
}


def _cut(path: Path, size: int) -> None:
    path.write_bytes(path.read_bytes()[:size])


def _swap(path: Path, column: str, value: str | None) -> None:
    """Another value in the first row, or the column renamed."""
    head, first, *rest = path.read_text().splitlines()
    at = head.split(",").index(column)
    cells = (head if value is None else first).split(",")
    cells[at] = value or "other"
    lines = [",".join(cells), first, *rest] if value is None else [head, ",".join(cells), *rest]
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize(
    ("damage", "sealed"),
    [*((damage, True) for damage in DAMAGES), ("no setting", False), ("generation cut", False)],
)
def test_a_damaged_run_is_left_out_and_said_in_one_line(
    damage: str, sealed: bool, sweep: Path, tmp_path: Path, capsys: Capture, caplog: Log
) -> None:
    for name in ("silent_seed-2", "stuck_seed-10"):
        shutil.copytree(sweep / name, tmp_path / "sweep" / name)
    victim = tmp_path / "sweep" / "stuck_seed-10"
    DAMAGES[damage](victim)
    if sealed:  # as by another version of evoros
        reseal(victim)
    before = everything(victim)
    shown = load_study([tmp_path / "sweep"]).generations["run"]
    (line,) = caplog.messages
    assert str(victim) in line
    assert line.endswith("; left out")
    assert "\n" not in line
    assert set(shown) == {"silent_seed-2"}
    assert everything(victim) == before  # and nothing of it is changed
    assert evoros_analyze(["fitness", str(victim), "--output", str(tmp_path / "none")]) == INPUT
    assert "Traceback" not in capsys.readouterr().err
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("arguments", [[], ["painting"], ["fitness"], ["fitness", "--format", "x"]])
def test_wrong_arguments_are_said_in_one_line(arguments: list[str], capsys: Capture) -> None:
    assert evoros_analyze(arguments) == INPUT
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert err.startswith("evoros analyze: ")


def test_an_empty_folder_beside_a_run_is_said(sweep: Path, tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "empty").mkdir()
    run = str(sweep / "silent_seed-2")
    given = ["fitness", run, str(tmp_path / "empty"), "--output", str(tmp_path / "out")]
    assert evoros_analyze([*given, "--format", "svg"]) == DONE
    assert capsys.readouterr().err == f"{tmp_path / 'empty'} contains no runs and is left out\n"
    with pytest.raises(InputError, match="no complete run or evaluation was found"):
        load_study([tmp_path / "empty"])
    with pytest.raises(InputError, match="folder not found"):
        load_study([tmp_path / "nowhere"])


def test_an_output_that_cannot_be_written_is_said(
    sweep: Path, tmp_path: Path, capsys: Capture
) -> None:
    (tmp_path / "file").write_text("mine")
    arguments = ["fitness", str(sweep), "--output", str(tmp_path / "file")]
    assert evoros_analyze(arguments) == INPUT
    assert "--output" in capsys.readouterr().err
    assert (tmp_path / "file").read_text() == "mine"


# Names and labels ---------------------------------------------------------------------------

PARTS = st.lists(st.sampled_from(["a", "b", "c"]), min_size=1, max_size=3)


@given(st.lists(PARTS, unique_by=tuple, max_size=8))
def test_short_names_are_distinct_ends_of_the_paths(paths: list[list[str]]) -> None:
    folders = [Path("/", *parts) for parts in paths]
    names = shorten_names(folders)
    assert len(set(names.values())) == len(folders)
    assert all(str(folder).endswith(names[folder].removeprefix("//")) for folder in folders)


def test_nothing_is_looked_for_inside_a_run(tmp_path: Path) -> None:
    for folder in ("b10", "b9", "b9/figures/c", ".hidden/d"):
        (tmp_path / folder).mkdir(parents=True, exist_ok=True)
        (tmp_path / folder / "config.yaml").touch()
    assert find_folders([tmp_path]) == [tmp_path / "b9", tmp_path / "b10"]


def conditions(**more: Any) -> dict[str, Any]:
    return {
        "seed": 0,
        "failure._target_": "evoros.failure.none.NoFailure",
        "world.maze.sdf": "maze.sdf",
        "trials": 1,
        **more,
    }


RANDOM = {"failure._target_": "evoros.failure.random.RandomFailure", "failure.count": 1}
CHOSEN = {"NoFailure": {"failure": "none"}, "RandomFailure": {"failure": "random"}}


def chosen(values: dict[str, Any]) -> dict[str, str]:
    return CHOSEN[values["failure._target_"].rpartition(".")[2]]


@pytest.mark.parametrize(
    ("configurations", "expected"),
    [
        ([conditions(), conditions(seed=1)], [SINGLE, SINGLE]),
        ([conditions(), conditions(**RANDOM)], ["none", "random"]),
        ([conditions(), conditions(trials=2)], ["trials 1", "trials 2"]),
        (
            [conditions(), conditions(seed=3), conditions(**RANDOM, trials=2)],
            ["failure none, trials 1"] * 2 + ["failure random, trials 2"],
        ),
        ([conditions(), conditions(**{"world.yard.sdf": "y"})], ["maze", "maze+yard"]),
        ([conditions(), conditions(**{"executor.workers": 3})], [SINGLE, SINGLE]),
    ],
)
def test_labels_say_what_differs(configurations: list[dict[str, Any]], expected: list[str]) -> None:
    assert label_treatments(configurations, list(map(chosen, configurations))) == expected


def test_a_part_is_named_by_its_choice_and_without_one_by_its_class() -> None:
    recorded = {
        "failure": "mine",
        "filter@failure.effect": "stuck",
        "controller/navigation": "l1",
        "world/course@course": "square",
        "experiment": None,
    }
    choices = read_choices(recorded)
    assert choices == {
        "failure": "mine",
        "failure.effect": "stuck",
        "controller.navigation": "l1",
        "course": "square",
    }
    targets = {"failure._target_": "mine.parts.Burst", "simulator._target_": "mine.parts.Moon"}
    assert name_part("failure", targets, choices) == "mine"
    assert name_part("simulator", targets, choices) == "Moon"
    assert read_choices(None) == read_choices(["failure"]) == {}


def test_treatments_of_one_class_are_told_apart_by_their_choices_alone_if_they_differ() -> None:
    """The same values are one treatment, whatever they were chosen by."""
    same = [conditions(), conditions()]
    assert label_treatments(same, [{"failure": "none"}, {"failure": "calm"}]) == [SINGLE, SINGLE]
    odd = [conditions(), conditions(**{"failure._target_": "mine.none.Calm"})]
    assert label_treatments(odd, [{"failure": "none"}, {"failure": "calm"}]) == ["none", "calm"]
    assert label_treatments(odd, [{}, {}]) == ["NoFailure", "Calm"]


CONDITIONS = st.fixed_dictionaries(
    {
        "seed": st.integers(0, 2),
        "trials": st.integers(1, 3),
        "failure._target_": st.sampled_from(["a.none.None", "a.random.Random"]),
        "controller.gain": st.sampled_from([0.5, 1.0]),
    }
)


@given(st.lists(CONDITIONS, max_size=6))
def test_runs_have_one_label_if_and_only_if_they_differ_in_nothing_but_seeds(
    configurations: list[dict[str, Any]],
) -> None:
    names = label_treatments(configurations)
    for one, name in zip(configurations, names, strict=True):
        for other, other_name in zip(configurations, names, strict=True):
            alike = {**one, "seed": 0} == {**other, "seed": 0}
            assert (name == other_name) == alike


def test_references_are_followed_and_the_environment_is_not(tmp_path: Path) -> None:
    tree = {
        "seed": 3,
        "a": {"b": "${seed}", "c": "${a.d}", "d": {"e": [1, 2]}},
        "round": "${trip}",
        "trip": "${round}",
        "token": "${oc.env:HOME}",
    }
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(tree))
    values = read_values(tmp_path / "config.yaml")
    assert values["a.b"] == 3
    assert values["a.c.e"] == [1, 2]
    assert values["token"] == "${oc.env:HOME}"
    assert {"round", "trip"} <= set(values)
    assert json.dumps(values)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fitness", "compare", "strategies", "overlay"])
def test_copies_of_runs_change_no_table(
    name: str, sweep: Path, tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    monkeypatch.setattr("evoros.analysis.command.render", lambda *_, **__: b"")
    copies = tmp_path / "copies"
    for run in ("silent_seed-2", "stuck_seed-2", "stuck_seed-10"):
        for number in range(3):
            shutil.copytree(sweep / run, copies / f"{run}_{number}")
    results = []
    for folders in ([sweep], [sweep, copies]):
        out = tmp_path / f"out_{len(folders)}"
        status = evoros_analyze([name, *map(str, folders), "--output", str(out), "--format=svg"])
        said = capsys.readouterr()
        tables = {file.name: file.read_text() for file in sorted(out.glob("*.csv"))}
        printed = [line for line in said.out.splitlines() if str(out) not in line]
        results.append((status, tables, printed))
        reports = [line for line in said.err.splitlines() if "seed of another run" in line]
        assert len(reports) == len(folders) - 1
        assert all(line.count(" (as ") == 6 and "and 3 more" in line for line in reports)
    assert results[0] == results[1]


def test_of_copies_the_one_that_got_furthest_counts(sweep: Path, tmp_path: Path) -> None:
    stopped = {"state": "stopped", "generations_done": 1}
    vary(sweep / "stuck_seed-2", tmp_path / "a", {"executor.workers": 7}, stopped)
    vary(sweep / "stuck_seed-2", tmp_path / "b", {"record": "none"})
    vary(sweep / "stuck_seed-2", tmp_path / "c", {"treatment.name": "another"})
    vary(sweep / "stuck_seed-2", tmp_path / "d", {"trials": 9})
    study = load_study([tmp_path])
    assert [record.name for record in study.records] == ["b", "c", "d"]
    assert [record.name for record in study.given] == ["a", "b", "c", "d"]
