"""Two runs of one configuration are equal as folders, and evoros diff tells so, or where not."""

import json
import random
from pathlib import Path

import pytest
from fixture_types import Capture, Folders, Patch
from helpers import content, copied, cut, everything, reseal, resume, tiny, vary

from evoros.cli.diff import diff
from evoros.session.diff import find_difference
from evoros.terminal.console import DIFFERENT, DONE, INPUT

ALL = ("record=all", "optimizer.generations=2")


@pytest.fixture(scope="module")
def run(tmp_path_factory: Folders) -> Path:
    folder = tmp_path_factory.mktemp("one") / "run"
    assert tiny(folder, *ALL, "figures=[fitness]") == DONE
    return folder


@pytest.fixture(scope="module")
def twin(tmp_path_factory: Folders) -> Path:
    """The same run on two workers, which finish missions in any order."""
    folder = tmp_path_factory.mktemp("other") / "run"
    workers = ("executor=processes", "executor.workers=2", "simulator.pause_s=0.01")
    assert tiny(folder, *ALL, *workers, "figures=[fitness]") == DONE
    return folder


def compared(one: Path, other: Path, capsys: Capture) -> tuple[int, str]:
    capsys.readouterr()
    status = diff([str(one), str(other)])
    out, err = capsys.readouterr()
    return status, out + err


@pytest.mark.slow
def test_two_runs_of_one_configuration_are_equal_as_folders(run: Path, tmp_path: Path) -> None:
    assert tiny(tmp_path / "run", *ALL, "figures=[fitness]") == DONE
    one, other = everything(run), everything(tmp_path / "run")
    manifests = [json.loads(files.pop("manifest.json")) for files in (one, other)]
    for files in (one, other):
        assert files.pop("evoros.log")
        assert files.pop("status.json")
    for manifest in manifests:
        assert manifest.pop("created")
        assert manifest.pop("digest")
    assert one == other
    assert manifests[0] == manifests[1]


def test_missions_are_in_the_order_of_their_keys(run: Path) -> None:
    lines = (run / "missions.csv").read_text().splitlines()[1:]
    cells = [line.split(",") for line in lines]
    keys = [(int(row[0]), int(row[1]), row[2], int(row[3])) for row in cells]
    assert keys == sorted(keys)
    assert len(keys) == len(set(keys))


def test_a_sorted_table_is_left_as_it_is(run: Path, tmp_path: Path) -> None:
    folder = copied(run, tmp_path / "run")
    before = (folder / "missions.csv").stat()
    assert resume(folder) == DONE
    after = (folder / "missions.csv").stat()
    assert (after.st_ino, after.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)


# evoros diff -------------------------------------------------------------------------------


def test_what_changes_no_result_is_named_and_makes_no_difference(
    run: Path, tmp_path: Path, capsys: Capture
) -> None:
    other = vary(run, tmp_path / "run", {"executor": {"_target_": "Processes"}, "figures": []})
    status, text = compared(run, other, capsys)
    missions = (run / "missions.csv").read_text().count("\n") - 1
    assert status == DONE
    assert text.startswith(f"equal: {missions} missions, ")
    assert text.endswith("made with different executor, figures\n")


def test_a_setting_that_differs_is_named(run: Path, twin: Path, capsys: Capture) -> None:
    status, text = compared(run, twin, capsys)
    assert status == DIFFERENT
    pause = f"config.yaml: simulator.pause_s is 0.0 in {run} and 0.01 in {twin}"
    assert text == f"different: {pause}\n"
    assert content(run) == content(twin)


@pytest.mark.parametrize(
    ("file", "column", "line"),
    [("missions.csv", "distance_m", 4), ("generations/00001.csv", "fitness", 3)],
)
def test_a_cell_that_differs_is_named(
    file: str, column: str, line: int, run: Path, tmp_path: Path, capsys: Capture
) -> None:
    folder = copied(run, tmp_path / "run")
    lines = (folder / file).read_text().split("\n")
    cells = lines[line - 1].split(",")
    at = lines[0].split(",").index(column)
    before, cells[at] = cells[at], "0.25"
    lines[line - 1] = ",".join(cells)
    (folder / file).write_text("\n".join(lines))
    reseal(folder)
    status, text = compared(run, folder, capsys)
    assert status == DIFFERENT
    assert text.startswith(f"different: {file}: line {line}")
    assert text.endswith(f"{column} is {before} in {run} and 0.25 in {folder}\n")


@pytest.mark.parametrize("cell", ["x" * 200_000, "\x1b[2J"])
def test_an_odd_cell_that_differs_is_told_in_one_plain_line(
    cell: str, run: Path, tmp_path: Path, capsys: Capture
) -> None:
    folder = copied(run, tmp_path / "run")
    table = folder / "champion" / "trajectory_near.csv"
    table.write_text(table.read_text().replace("\n0.0,", f"\n{cell},", 1))
    reseal(folder)
    status, text = compared(run, folder, capsys)
    assert status == DIFFERENT
    assert text.startswith("different: champion/trajectory_near.csv: line 2")
    assert text.count("\n") == 1
    assert text[:-1].isprintable()
    assert len(text) < 1000


@pytest.mark.slow
def test_any_byte_that_differs_is_told(run: Path, tmp_path: Path, capsys: Capture) -> None:
    """A byte in each file, and each file deleted: one line that names the file."""
    rng = random.Random(3)
    folder = copied(run, tmp_path / "run")
    names = [n for n in everything(run) if n not in ("evoros.log", "status.json", "manifest.json")]
    assert len(names) > 30
    for name in names:
        whole = (folder / name).read_bytes()
        at = rng.randrange(len(whole))
        other = bytes([whole[at] ^ (1 << rng.randrange(8))])
        (folder / name).write_bytes(whole[:at] + other + whole[at + 1 :])
        if name != "config.yaml":  # a comment or a blank may differ
            check_told(name, compared(run, folder, capsys))
        (folder / name).unlink()
        if not name.startswith("figures"):  # they can be drawn at any time
            check_told(name, compared(run, folder, capsys))
        (folder / name).write_bytes(whole)
    assert compared(run, folder, capsys)[0] == DONE


def test_a_table_of_a_figure_may_name_the_folder_that_it_was_drawn_in(tmp_path: Path) -> None:
    """A reproduced run has another folder; the tables of other files name none."""
    one, other = folders = [tmp_path / name for name in ("one", "other")]
    for folder, value in zip(folders, (1, 1), strict=True):
        for part in ("figures", "champion"):
            (folder / part).mkdir(parents=True)
            (folder / part / "a.csv").write_text(f"run,value\n{folder.name},{value}\n")
    assert find_difference(one, other, "figures/a.csv") == ""
    assert "run is one in" in find_difference(one, other, "champion/a.csv")
    (other / "figures" / "a.csv").write_text("run,value\nother,2\n")
    assert find_difference(one, other, "figures/a.csv").startswith("figures/a.csv: line 2: ")
    for folder in (one, other):  # a name in another column is a value as any other
        (folder / "figures" / "a.csv").write_text(f"run,value\n{folder.name},{folder.name}\n")
    assert find_difference(one, other, "figures/a.csv").startswith("figures/a.csv: line 2: ")


def check_told(name: str, answer: tuple[int, str]) -> None:
    status, text = answer
    assert status in (DIFFERENT, INPUT), name
    assert name in text
    assert text.count("\n") == 1


def test_sweeps_are_compared_by_the_paths_of_their_jobs(
    run: Path, tmp_path: Path, capsys: Capture
) -> None:
    for study in ("a", "b"):
        for seed in ("1", "2"):
            (tmp_path / study).mkdir(exist_ok=True)
            copied(run, tmp_path / study / seed)
    status, text = compared(tmp_path / "a", tmp_path / "b", capsys)
    assert status == DONE
    assert text.startswith("equal: 2 folders, ")
    (tmp_path / "b" / "2").rename(tmp_path / "b" / "3")
    assert compared(tmp_path / "a", tmp_path / "b", capsys) == (
        DIFFERENT,
        f"different: 2: not found in {tmp_path / 'b'}\n",
    )


def test_an_unfinished_run_lacks_missions(run: Path, tmp_path: Path, capsys: Capture) -> None:
    folder = copied(run, tmp_path / "run")
    cut(folder, (run / "missions.csv").stat().st_size - 3)
    status, text = compared(run, folder, capsys)
    assert status == DIFFERENT
    assert "the mission generation 1, design " in text
    assert text.endswith(f"is only in {run}\n")


@pytest.mark.parametrize(
    "names", [[], ["nix", "nix"], ["."], [".", ".", "."], [".", "."], ["RUN", ".."]]
)
def test_what_cannot_be_compared_is_one_line(
    names: list[str], run: Path, tmp_path: Path, monkeypatch: Patch, capsys: Capture
) -> None:
    (tmp_path / "empty").mkdir()
    copied(run, tmp_path / "run")
    monkeypatch.chdir(tmp_path / "empty")
    assert diff([str(run) if name == "RUN" else name for name in names]) == INPUT
    assert capsys.readouterr().err.count("\n") == 1
