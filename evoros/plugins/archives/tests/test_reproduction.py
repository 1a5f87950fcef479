"""evoros reproduce runs a folder again from its record; the folder itself is never touched."""

import json
import os
import shutil
from pathlib import Path

import pytest
from fixture_types import Capture, Folders, Patch
from helpers import USER_PARTS, copied, cut, everything, reseal, resume, scored, tiny

from evoros.plugins.archives.reproduce import reproduce
from evoros.terminal.console import DIFFERENT, DONE, INPUT

OWN = ("--config-dir", str(USER_PARTS))
SAME = "made with the same packages, commit, processor and operating system\n"


@pytest.fixture(scope="module")
def run(tmp_path_factory: Folders) -> Path:
    """A run that was extended after its end."""
    folder = tmp_path_factory.mktemp("one") / "run"
    assert tiny(folder, "record=all", "optimizer.generations=1", "figures=[fitness]") == DONE
    assert resume(folder, "optimizer.generations=2") == DONE
    return folder


def times(folder: Path) -> dict[str, int]:
    return {path: os.stat(path).st_mtime_ns for path in map(str, folder.rglob("*"))}


def reproduced(folder: Path, new: Path, capsys: Capture, *more: str) -> tuple[int, str, str]:
    """The status and what was printed; the folder has the bytes and the dates of before."""
    before = everything(folder), times(folder)
    capsys.readouterr()
    status = reproduce([str(folder), "--output", str(new), *more])
    out, err = capsys.readouterr()
    assert (everything(folder), times(folder)) == before
    return status, out, err


def change_mission(folder: Path) -> None:
    """Change one cell of the third mission, as if another processor had computed it."""
    lines = (folder / "missions.csv").read_text().split("\n")
    cells = lines[3].split(",")
    cells[lines[0].split(",").index("distance_m")] = "0.25"
    lines[3] = ",".join(cells)
    (folder / "missions.csv").write_text("\n".join(lines))
    reseal(folder)


@pytest.mark.slow
def test_an_extended_run_is_reproduced_to_the_byte(
    run: Path, tmp_path: Path, capsys: Capture
) -> None:
    workers = ("executor=processes", "executor.workers=2")
    status, out, _ = reproduced(run, tmp_path / "new", capsys, *OWN, *workers)
    assert (status, out.startswith(f"{SAME}equal: ")) == (DONE, True), out
    assert out.count("\n") == 2
    names = ("missions.csv", "generations/00001.csv", "champion/design.csv", "figures/fitness.pdf")
    assert all((run / n).read_bytes() == (tmp_path / "new" / n).read_bytes() for n in names)


@pytest.mark.slow
def test_an_evaluation_and_a_sweep_are_reproduced(
    run: Path, tmp_path: Path, capsys: Capture, monkeypatch: Patch
) -> None:
    """The current folder has changed, and the runs that the evaluation scored are missing."""
    study = tmp_path / "study"
    scored(study / "scores", run, "trials=2")
    (study / "deeper").mkdir()
    copied(run, study / "deeper" / "run")
    monkeypatch.chdir(tmp_path)
    status, out, err = reproduced(Path("study"), Path("new"), capsys, *OWN)
    assert (status, "equal: 2 folders, " in out) == (DONE, True), err
    scores = "designs.csv"
    assert (study / "scores" / scores).read_bytes() == Path("new", "scores", scores).read_bytes()


@pytest.mark.slow
def test_the_first_mission_that_differs_is_named_and_what_may_be_why(
    run: Path, tmp_path: Path, capsys: Capture
) -> None:
    folder = copied(run, tmp_path / "run")
    manifest = json.loads((folder / "manifest.json").read_text())
    now = manifest["packages"]["numpy"]
    manifest["packages"]["numpy"] = "0.1"
    manifest |= {"commit": "1" * 40, "dirty": True, "processor": "An abacus"}
    (folder / "manifest.json").write_text(json.dumps(manifest))
    reseal(folder)
    change_mission(folder)
    status, out, err = reproduced(folder, tmp_path / "new", capsys, *OWN)
    made, difference = out.splitlines()
    assert status == DIFFERENT
    assert difference.startswith("different: missions.csv: line 4 (the mission generation 0, ")
    assert f"numpy {now} (was 0.1)" in made
    assert f"(was {'1' * 40} with changed files)" in made
    assert "(was An abacus)" in made
    assert "operating system" not in made
    assert "0.1; now" not in err  # it is said once


@pytest.mark.slow
def test_an_interrupted_reproduction_goes_on(run: Path, tmp_path: Path, capsys: Capture) -> None:
    new = copied(run, tmp_path / "new")
    cut(new, (new / "missions.csv").stat().st_size // 3)
    (new / "status.json").unlink()
    status, out, _ = reproduced(run, new, capsys, *OWN)
    assert (status, "equal: " in out) == (DONE, True)


def unfinished(folder: Path) -> None:
    status = json.loads((folder / "status.json").read_text())
    (folder / "status.json").write_text(json.dumps(status | {"state": "stopped"}))
    reseal(folder)


def damaged(folder: Path) -> None:
    content = (folder / "config.yaml").read_bytes()
    (folder / "config.yaml").write_bytes(bytes([content[0] ^ 1]) + content[1:])


def emptied(folder: Path) -> None:
    shutil.rmtree(folder)
    folder.mkdir()


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (unfinished, "must be finished"),
        (damaged, "config.yaml"),
        (emptied, "must be the folder of a run"),
    ],
)
def test_what_cannot_be_reproduced_is_one_line(
    spoil: object, said: str, run: Path, tmp_path: Path, capsys: Capture
) -> None:
    folder = copied(run, tmp_path / "run")
    assert callable(spoil)
    spoil(folder)
    status, out, err = reproduced(folder, tmp_path / "new", capsys, *OWN)
    assert (status, out, err.count("\n")) == (INPUT, "", 1), err
    assert said in err
    assert not (tmp_path / "new").exists()


@pytest.mark.slow
def test_nothing_is_written_into_the_folder_given_or_a_strange_one(
    run: Path, tmp_path: Path, capsys: Capture
) -> None:
    strange = tmp_path / "strange"
    more = ("record=all", "optimizer.generations=1", "figures=[fitness]", "seed=9")
    assert tiny(strange, *more) == DONE
    before = everything(strange)
    for new in (run, run / "new", strange):
        status, _, err = reproduced(run, new, capsys, *OWN)
        assert (status, err.count("\n")) == (INPUT, 1), err
    assert "seed is 9" in err
    assert everything(strange) == before


@pytest.mark.parametrize("typed", ["seed=3", "optimizer.generations=9", "--nonsense"])
def test_only_the_executor_may_be_another(
    typed: str, run: Path, tmp_path: Path, capsys: Capture
) -> None:
    status, _, err = reproduced(run, tmp_path / "new", capsys, *OWN, typed)
    assert (status, err.count("\n"), typed in err) == (INPUT, 1, True)
    assert not (tmp_path / "new").exists()


def test_the_code_of_others_runs_only_if_it_is_named(
    run: Path, tmp_path: Path, capsys: Capture, monkeypatch: Patch
) -> None:
    monkeypatch.setattr("evoros.session.rebuilding.NAMED_FOLDERS", [])  # as in a new process
    status, _, err = reproduced(run, tmp_path / "new", capsys)
    assert (status, err.count("\n")) == (INPUT, 1)
    assert "add --config-dir" in err
    assert not (tmp_path / "new").exists()


def test_help_and_version(capsys: Capture) -> None:
    assert reproduce(["--help"]) == reproduce(["--version"]) == DONE
    assert "FOLDER" in capsys.readouterr().out
