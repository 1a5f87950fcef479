"""A run draws its own figures when it is finished, whatever becomes of them."""

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest
from fixture_types import Capture, Folders, Patch
from helpers import content, copied, everything, resume, tiny

from evoros.terminal.console import DONE, INPUT

WANTED = "figures=[overlay,fitness,mission]"
PICTURES = {"overlay.pdf", "fitness.pdf", "mission.pdf"}
TABLES = {"overlay.csv", "fitness.csv", "mission.csv"}


@pytest.fixture(scope="module")
def run(tmp_path_factory: Folders) -> Path:
    folder = tmp_path_factory.mktemp("first") / "run"
    assert tiny(folder, WANTED) == DONE
    return folder


def state(folder: Path) -> object:
    return json.loads((folder / "status.json").read_text())["state"]


def stamps(folder: Path) -> dict[str, int]:
    return {file.name: file.stat().st_mtime_ns for file in (folder / "figures").iterdir()}


@pytest.mark.slow
def test_a_run_leaves_its_figures_with_their_numbers_and_nothing_else(run: Path) -> None:
    names = set(stamps(run))
    assert names >= PICTURES | TABLES
    assert all(name.split(".")[0].split("_")[0] in WANTED for name in names)
    assert all((run / "figures" / name).read_bytes().startswith(b"%PDF") for name in PICTURES)
    points = pd.read_csv(run / "figures" / "fitness.csv")
    assert len(points) == sum(len(pd.read_csv(file)) for file in run.glob("generations/*.csv"))
    assert (
        f"figures in {run / 'figures'}: overlay, fitness, mission"
        in (run / "evoros.log").read_text()
    )


@pytest.mark.slow
def test_the_summary_says_where(run: Path, tmp_path: Path, capsys: Capture) -> None:
    assert resume(run) == DONE
    assert f"run folder        {run}, with champion/ and figures/\n" in capsys.readouterr().out
    assert tiny(tmp_path / "bare", "figures=[]", "optimizer.generations=1") == DONE
    assert "figures" not in capsys.readouterr().out
    assert not (tmp_path / "bare" / "figures").exists()


@pytest.mark.slow
def test_workers_draw_what_is_missing_and_nothing_again(run: Path, tmp_path: Path) -> None:
    folder = copied(run, tmp_path / "run")  # of the same name
    before = stamps(folder)
    for file in (folder / "figures").glob("fitness.*"):
        file.unlink()
    assert resume(folder, "executor=processes", "executor.workers=1") == DONE
    assert everything(folder / "figures") == everything(run / "figures")
    after = stamps(folder)
    kept = [name for name in before if not name.startswith("fitness")]
    assert all(after[name] == before[name] for name in kept)


@pytest.mark.slow
def test_an_extended_run_draws_all_of_itself_again(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    assert tiny(folder, "figures=[fitness]", "optimizer.generations=1") == DONE
    assert resume(folder, "optimizer.generations=2") == DONE
    points = pd.read_csv(folder / "figures" / "fitness.csv")
    assert set(points["generation"]) == {0, 1}


@pytest.mark.slow
def test_a_figure_that_raises_leaves_a_finished_run_and_one_warning(
    run: Path, tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    def failing(*_: object) -> None:
        raise ZeroDivisionError("no\nluck")

    monkeypatch.setattr("evoros.analysis.figures.fitness.make_product", failing)
    folder = tmp_path / "run"
    assert tiny(folder, WANTED) == DONE
    said = [line for line in capsys.readouterr().err.splitlines() if "no luck" in line]
    assert said == [f"{folder / 'figures'}: fitness: cannot be drawn (ZeroDivisionError: no luck)"]
    assert state(folder) == "finished"
    assert content(folder) == content(run)
    assert {file.suffix for file in (folder / "figures").iterdir()} == {".pdf", ".csv"}
    assert not list((folder / "figures").glob("fitness*"))


@pytest.mark.slow
def test_where_nothing_can_be_written_the_run_is_finished_all_the_same(
    run: Path, tmp_path: Path, capsys: Capture
) -> None:
    """There is a file in the place of the folder."""
    folder = copied(run, tmp_path / "run")
    shutil.rmtree(folder / "figures")
    (folder / "figures").write_text("")
    capsys.readouterr()
    assert resume(folder) == DONE
    warnings = [line for line in capsys.readouterr().err.splitlines() if "fitness: " in line]
    assert len(warnings) == 1
    assert "cannot be drawn" in warnings[0]
    assert state(folder) == "finished"


@pytest.mark.parametrize("names", ["[fitnes]", "fitness", "[fitness,fitness]", "[1]", "null"])
def test_a_wrong_name_is_one_line_before_the_run(
    names: str, tmp_path: Path, capsys: Capture
) -> None:
    assert tiny(tmp_path / "run", f"figures={names}") == INPUT
    said = capsys.readouterr().err
    assert "figures: must be a list of different subcommands of evoros analyze" in said
    assert said.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
