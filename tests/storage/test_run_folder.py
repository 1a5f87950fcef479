import errno
import json
import os
import random
import subprocess
from pathlib import Path

import pytest
from executor_calls import alive, wait_until
from fixture_types import Capture, Folders, Patch
from helpers import (
    TINY,
    content,
    copied,
    cut,
    everything,
    finished_run,
    reseal,
    resume,
    start,
    tiny,
    wait_for_missions,
)

from evoros.base.errors import InputError
from evoros.cli.main import evoros
from evoros.storage.creation import create_folder
from evoros.storage.figure_context import FigureContext
from evoros.storage.layout import CONFIG, MANIFEST, MISSIONS
from evoros.storage.run_folder import RunFolder
from evoros.terminal.console import DONE, INPUT
from evoros.world.loading import load_world

BARE = FigureContext("robot", (), {}, {}, {}, False, (), (), {})


@pytest.fixture(scope="module")
def whole(tmp_path_factory: Folders) -> Path:
    """An uninterrupted run."""
    return finished_run(tmp_path_factory.mktemp("whole") / "run")


@pytest.mark.parametrize("seed", range(2))
def test_a_run_cut_anywhere_ends_with_the_same_bytes(
    seed: int, whole: Path, tmp_path: Path
) -> None:
    run = copied(whole, tmp_path / "run")
    size = (run / "missions.csv").stat().st_size
    header = (run / "missions.csv").read_bytes().index(b"\n") + 1
    cut(run, random.Random(seed).randrange(header, size))
    assert resume(run, "executor=serial") == DONE
    assert content(run) == content(whole)


@pytest.mark.slow
def test_a_killed_run_ends_with_the_same_bytes_and_leaves_no_process(
    whole: Path, tmp_path: Path
) -> None:
    """And whatever the status counts was already in the table when the kill came."""
    arguments = [*TINY, "simulator.pause_s=0.2", "executor.workers=2", "hydra.run.dir=run"]
    process = start(arguments, tmp_path)
    wait_for_missions(tmp_path / "run", 6)
    workers = children(process.pid)
    process.kill()
    process.communicate()
    status = json.loads((tmp_path / "run" / "status.json").read_text())
    rows = (tmp_path / "run" / "missions.csv").read_bytes().count(b"\n") - 1
    assert status["state"] == "running"
    assert rows >= status["missions"]
    assert resume(tmp_path / "run", "executor=serial") == DONE
    assert content(tmp_path / "run") == content(whole)
    assert wait_until(lambda: not any(map(alive, workers)), 60)


def children(pid: int) -> list[int]:
    listed = subprocess.run(["pgrep", "-P", str(pid)], capture_output=True, text=True, check=False)
    return [int(line) for line in listed.stdout.split()]


def test_a_character_cut_in_half_is_only_a_row_cut_short(tmp_path: Path) -> None:
    whole, run = tmp_path / "whole", tmp_path / "run"
    assert tiny(whole, "simulator.fault=fail", "optimizer.generations=1") == DONE
    copied(whole, run)
    cut(run, (run / "missions.csv").read_bytes().index("“".encode()) + 1)
    assert resume(run) == DONE
    assert content(run) == content(whole)


def test_resuming_a_finished_run_verifies_it_and_changes_nothing(
    whole: Path, tmp_path: Path, capsys: Capture
) -> None:
    run = copied(whole, tmp_path / "run")
    stamps = {path: path.stat().st_mtime_ns for path in (run / "champion").iterdir()}
    assert resume(run) == DONE
    assert ", 0 of them in this session" in capsys.readouterr().out
    assert content(run) == content(whole)
    assert stamps == {path: path.stat().st_mtime_ns for path in (run / "champion").iterdir()}


@pytest.mark.slow
def test_an_extended_run_is_a_longer_run(whole: Path, tmp_path: Path) -> None:
    longer, run = tmp_path / "longer", copied(whole, tmp_path / "run")
    assert tiny(longer, "optimizer.generations=6") == DONE
    assert resume(run, "optimizer.generations=5") == DONE
    one = ("executor=processes", "executor.workers=1")
    assert resume(run, "optimizer.generations=6", *one) == DONE
    assert content(run) == content(longer)
    assert (run / "config.yaml").read_bytes() == (whole / "config.yaml").read_bytes()
    assert resume(run) == DONE  # still six
    assert content(run) == content(longer)


@pytest.mark.parametrize(
    "override",
    [
        *("optimizer.generations=2", "optimizer.generations=many", "optimizer.generations=4,5"),
        *("seed=1", "~failure", "executor=nix", "executor.nix=1", "executor=["),
        *("hydra.run.dir=elsewhere", "-m"),
    ],
)
def test_resuming_refuses_other_overrides_untouched(
    override: str, whole: Path, tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    before = everything(whole)
    assert resume(whole, override) == INPUT
    assert capsys.readouterr().err.count("\n") == 1
    assert everything(whole) == before
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("config.yaml", "trials: 1", "trials: 2", "replaying the run gives a table that differs"),
        ("config.yaml", "trials: 1", "trials: [", "line"),
        ("manifest.json", '"format_version": 1', '"format_version": 2', "format_version must be"),
        ("missions.csv", "\n0,0,", "\n0,zero,", "line 2: this version cannot read the row"),
        ("generations/00001.csv", "\n1,", "\n1,9", "replaying the run gives a table that differs"),
        ("missions.csv", "/selection/", "/selected/", "or was edited"),
    ],
)
def test_a_run_that_was_edited_is_refused_in_one_line(
    file: str, old: str, new: str, said: str, whole: Path, tmp_path: Path, capsys: Capture
) -> None:
    run = copied(whole, tmp_path / "run")
    text = (run / file).read_text()
    assert old in text
    (run / file).write_text(text.replace(old, new, 1))
    edited = (reseal(run) / file).read_text()  # a version that writes other files
    assert resume(run) == INPUT
    lines = capsys.readouterr().err.strip().splitlines()
    assert said in lines[-1]
    assert lines[-1].startswith("evoros: ")
    assert (run / file).read_text() == edited


def test_an_edited_outcome_shows_in_the_replay(whole: Path, tmp_path: Path) -> None:
    run = copied(whole, tmp_path / "run")
    lines = (run / "missions.csv").read_text().splitlines(keepends=True)
    at = lines[0].split(",").index("progress")
    cells = lines[1].split(",")
    cells[at] = "0.123"
    (run / "missions.csv").write_text("".join([lines[0], ",".join(cells), *lines[2:]]))
    reseal(run)
    assert resume(run) == INPUT


@pytest.mark.slow
def test_files_may_be_relative_and_the_run_resumed_from_anywhere(
    tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    from evoros.files.resources import find_file

    (tmp_path / "here" / "worlds").mkdir(parents=True)
    world = tmp_path / "here" / "worlds" / "mine.sdf"
    world.write_text(find_file("boxes.sdf", "worlds").read_text())
    monkeypatch.chdir(tmp_path / "here")
    assert tiny(Path("run"), "world.near.sdf=worlds/mine.sdf") == DONE
    monkeypatch.chdir(tmp_path)
    assert resume(Path("here/run")) == DONE
    world.write_text(world.read_text().replace("4.914", "4.814", 1))
    capsys.readouterr()
    assert resume(Path("here/run")) == INPUT
    err = capsys.readouterr().err
    assert "world.near has changed since the run began" in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("folder", ["", "nix", ".", "..", "a,b", "${oc.env:HOME}", "nix=1"])
def test_resuming_what_is_no_run_is_one_line(
    folder: str, tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    monkeypatch.chdir(tmp_path)
    assert evoros(["resume", str(folder)]) == INPUT
    assert capsys.readouterr().err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_folder_has_one_writer(whole: Path, tmp_path: Path) -> None:
    run = copied(whole, tmp_path / "run")
    before = everything(run)
    with RunFolder(run):
        assert resume(run) == INPUT
        with pytest.raises(InputError, match="another process"):
            RunFolder(run)
    assert everything(run) == before


@pytest.mark.slow
def test_a_class_that_cannot_be_imported_is_one_line(
    whole: Path, tmp_path: Path, capfd: Capture
) -> None:
    process = start(["resume", str(whole)], tmp_path)
    _, err = process.communicate()
    assert process.returncode == INPUT
    assert "--config-dir with the folder that contains the module planar" in err
    assert err.count("\n") == 1


@pytest.mark.slow
def test_the_current_folder_is_used_where_it_is_empty(
    whole: Path, tmp_path: Path, monkeypatch: Patch
) -> None:
    """And stays itself: an empty mount point could not be replaced by another folder."""
    monkeypatch.chdir(tmp_path)
    before = tmp_path.stat()
    assert tiny(Path(".")) == DONE
    assert tmp_path.stat().st_ino == before.st_ino
    assert list(Path.cwd().iterdir()) != []
    assert content(tmp_path) == content(whole)
    assert resume(Path(".")) == DONE
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "link").symlink_to("elsewhere")
    assert tiny(Path("link"), "optimizer.generations=1") == DONE
    assert (tmp_path / "link").is_symlink()


@pytest.mark.parametrize("exists", [False, True])
@pytest.mark.parametrize("at", range(5))
def test_what_fails_while_the_folder_is_made_leaves_nothing(
    at: int, exists: bool, tmp_path: Path, monkeypatch: Patch
) -> None:
    run = tmp_path / "run"
    if exists:
        run.mkdir()
    calls = iter(range(100))
    replace = Path.replace

    def failing(path: Path, target: Path) -> Path:
        if next(calls) == at:
            raise OSError(28, "No space left on device")
        return replace(path, target)

    monkeypatch.setattr(Path, "replace", failing)
    moved = 4 if exists else 5  # manifest ... missions and a new folder are put in place
    if at >= moved:
        RunFolder.create(run, "", {}, BARE).__exit__()
        return
    with pytest.raises(InputError, match="cannot be created"):
        RunFolder.create(run, "", {}, BARE)
    assert list(tmp_path.rglob("*")) == ([run] if exists else [])


@pytest.mark.parametrize(
    ("number", "fix"),
    [
        (errno.ENOSPC, "free some space"),
        (errno.EDQUOT, "free some space"),
        (errno.EROFS, "choose another with hydra.run.dir"),
    ],
)
def test_a_folder_that_cannot_be_made_has_the_fix_of_its_disk(
    number: int, fix: str, tmp_path: Path, monkeypatch: Patch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("evoros.storage.creation._create_folder", refuse)
    with pytest.raises(InputError, match=f"cannot be created.*{fix}"):
        create_folder(tmp_path / "run", {CONFIG: "", MANIFEST: "{}", MISSIONS: "design\n"})


@pytest.mark.parametrize("parts", [1, 2])
def test_a_folder_that_a_kill_left_half_made_says_what_to_do(
    parts: int, whole: Path, tmp_path: Path, capsys: Capture
) -> None:
    run = tmp_path / "run"
    run.mkdir()
    for name in ("config.yaml", "manifest.json")[:parts]:
        (run / name).write_bytes((whole / name).read_bytes())
    before = everything(run)
    for command in (tiny, resume):
        assert command(run) == INPUT
        err = capsys.readouterr().err
        assert "killed before the first mission; delete the contents of the folder" in err
        assert err.count("\n") == 1
    assert everything(run) == before


def test_of_two_runs_that_are_made_in_one_folder_one_is_refused(
    tmp_path: Path, monkeypatch: Patch
) -> None:
    """The second looks before the first writes."""
    from evoros.storage import run_folder as record

    monkeypatch.setattr(record, "require_unused", lambda path: None)
    first = RunFolder.create(tmp_path, "first", {}, BARE)
    with pytest.raises(InputError):
        RunFolder.create(tmp_path, "second", {}, BARE)
    assert (tmp_path / "config.yaml").read_text() == "first"
    first.__exit__()


PYRAMID = """o pyramid
v -0.5 -0.5 0
v 0.5 -0.5 0
v 0.5 0.5 0
v -0.5 0.5 0
v 0 0 1
f 1 3 2
f 1 4 3
f 1 2 5
f 2 3 5
f 3 4 5
f 4 1 5
"""
TENT = """<sdf version="1.9"><world name="w"><gravity>0 0 -3.7</gravity>
<model name="tent"><static>true</static><pose>30 30 0 0 0 0</pose><link name="l">
<collision name="c"><geometry><mesh><uri>tent.obj</uri></mesh></geometry></collision>
</link></model></world></sdf>"""


@pytest.mark.slow
def test_the_worlds_of_a_champion_keep_their_meshes(tmp_path: Path) -> None:
    """They need no file of the world's author; a resumed run leaves them as they are."""
    (tmp_path / "tent.obj").write_text(PYRAMID)
    (tmp_path / "tent.sdf").write_text(TENT)
    run = tmp_path / "run"
    assert tiny(run, f"world.near.sdf={tmp_path / 'tent.sdf'}") == DONE
    kept = content(run)
    (tmp_path / "tent.obj").rename(tmp_path / "elsewhere.obj")
    context = FigureContext.read(run)
    world = load_world(str(run / "champion" / "world_near.sdf"), context.courses["near"])
    (tent,) = world.obstacles
    assert sorted(tent.shapes[0].corners)[-1] == (0.5, 0.5, 0.0)
    assert world.gravity_mps2 == 3.7
    (tmp_path / "elsewhere.obj").rename(tmp_path / "tent.obj")
    assert resume(run) == DONE
    assert content(run) == kept


def test_a_lost_trajectory_of_a_whole_time_limit_is_flown_again(tmp_path: Path) -> None:
    """A mission that ends at the limit has ``3`` in its row, which is read as ``3.0``."""
    run = tmp_path / "run"
    limits = [f"world.{name}.course.time_limit_s=3" for name in ("near", "far")]
    assert tiny(run, *limits, "record=all", "optimizer.generations=1") == DONE
    before = {name: file for name, file in everything(run).items() if name.startswith("traj")}
    rows = (run / "missions.csv").read_bytes()
    assert b",time_limit," in rows
    lost = next(iter(before))
    (run / lost).unlink()
    assert resume(run) == DONE
    assert (run / "missions.csv").read_bytes() == rows
    assert (run / lost).read_bytes() == before[lost]
