"""A row follows from a finished run, runs again to the same digest, and a forged one does not."""

import shlex
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

import evoros
from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.config.recorded import flatten, list_differences
from evoros.plugins.leaderboard import rows
from evoros.plugins.leaderboard.rows import SEARCH, TASKS, Row, make_row, read_rows, write_rows
from evoros.plugins.leaderboard.subcommand import leaderboard

FEW = (
    "experiment=benchmark_network",
    "optimizer=random_search",
    "optimizer.population_size=2",
    "optimizer.generations=1",
    "final_choice=none",
    "executor=serial",
    "figures=[]",
    "record=none",
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("leaderboard") / "run"
    evoros.run([*FEW, "seed=7", "draws=individual"], folder)
    return folder


@pytest.fixture(scope="module")
def row(run: Path) -> Row:
    return make_row(run)


def refuse(folder: Path) -> str:
    with pytest.raises(InputError) as caught:
        make_row(folder)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_row_states_what_the_run_reached(run: Path, row: Row) -> None:
    status = evoros.load_run(run).status
    assert (row.task, row.search, row.seed) == ("network", "random_search", "7")
    assert row.missions == "6"  # in three worlds
    assert float(row.fitness) == pytest.approx(status["best_validated_fitness"], abs=6e-4)
    assert float(row.low) <= float(row.fitness) <= float(row.high)
    assert status["validated_trials"] == 30


def test_its_overrides_compose_the_run_again(run: Path, row: Row) -> None:
    again = flatten(compose(shlex.split(row.overrides)))
    recorded = flatten(compose([*FEW, "seed=7", "draws=individual"]))
    assert list_differences(recorded, again, rows.FREE) == []
    assert "draws=individual" in shlex.split(row.overrides)


def test_rows_survive_the_file(row: Row, tmp_path: Path) -> None:
    file = tmp_path / "rows.csv"
    file.write_text(write_rows([row, replace(row, overrides="a='x, y'", seed="8")]))
    assert [one.seed for one in read_rows(file)] == ["7", "8"]
    assert read_rows(file)[1].overrides == "a='x, y'"


def check(file: Path, *more: str, lines: Sequence[Row]) -> int:
    file.write_text(write_rows(lines))
    return leaderboard(["--check", str(file), *more])


@pytest.mark.slow
def test_a_right_row_passes_and_a_forged_one_does_not(
    row: Row, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "rows.csv"
    better, known = replace(row, fitness="19.900"), tmp_path / "known.csv"
    known.write_text(write_rows([better]))  # of an earlier commit: it is not run again
    forged = replace(row, digest="0" * 64)
    assert check(file, "--known", str(known), lines=[row, better, forged]) == 1
    told = capsys.readouterr()
    assert "line 2 (network, random_search, seed 7): reproduced" in told.out
    assert "line 3" not in told.out + told.err
    assert "line 4 (network, random_search, seed 7): digest is" in told.err
    assert row.digest in told.err


def test_a_run_beyond_the_budget_is_refused(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rows, "TASKS", {**TASKS, "benchmark_network": 1})
    assert "benchmark_network is 1;" in refuse(run)


def test_an_unfinished_or_a_damaged_run_is_refused(run: Path, tmp_path: Path) -> None:
    stopped = tmp_path / "stopped"
    shutil.copytree(run, stopped)
    (stopped / "status.json").unlink()
    assert "stopped" in refuse(stopped)
    damaged = tmp_path / "damaged"
    shutil.copytree(run, damaged)
    table = damaged / "missions.csv"
    table.write_bytes(table.read_bytes().replace(b"dense_mixed", b"dense_fixed", 1))
    assert "missions.csv" in refuse(damaged)
    assert "folder not found" in refuse(tmp_path / "nothing")


def test_a_run_of_no_task_is_refused(tmp_path: Path) -> None:
    evoros.run([*FEW, "course.time_limit_s=5", "validation.trials=2"], tmp_path / "run")
    message = refuse(tmp_path / "run")
    assert "differs from benchmark_network in" in message
    assert "course.time_limit_s" in message
    assert "validation.trials" in message


@pytest.mark.slow
def test_a_score_of_more_trials_than_those_of_the_task_is_refused(tmp_path: Path) -> None:
    """The search has its own optimizer, but not its own exam."""
    evoros.run([*FEW, "optimizer.validation_trials=31"], tmp_path / "run")
    assert evoros.load_run(tmp_path / "run").status["validated_trials"] == 31
    assert "differs from benchmark_network in optimizer.validation_trials" in refuse(
        tmp_path / "run"
    )


@pytest.mark.parametrize("text", ["", "task,search\n", f"{','.join(rows.COLUMNS)}\n1,2\n"])
def test_a_file_of_other_columns_is_refused_in_one_line(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "rows.csv"
    file.write_text(text)
    assert leaderboard(["--check", str(file)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "rows.csv: line" in error


def test_a_folder_of_parts_that_others_do_not_have_is_refused(run: Path) -> None:
    with pytest.raises(InputError, match=r"^--config-dir /mine: must be a relative path"):
        make_row(run, "/mine")


def test_neither_folders_nor_a_file_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert leaderboard([]) == 2
    assert "FOLDER" in capsys.readouterr().err


@pytest.mark.parametrize("task", TASKS)
def test_a_task_fixes_all_but_the_search(task: str) -> None:
    composed = compose([f"experiment={task}"])
    assert composed.values["validation"]["trials"] == composed.values["validation"]["max_trials"]
    assert {key.partition(".")[0] for key in SEARCH} <= {*composed.values, "objectives"}
    assert composed.choices["final_choice"] == "halving"
