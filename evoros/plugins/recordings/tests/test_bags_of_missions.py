"""Bags of any mission of a run that keeps all trajectories."""

import shutil
from collections.abc import Hashable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from bag_readers import channels, read_mcap
from helpers import copied, finished_run, reseal

import evoros
from evoros.analysis.command import evoros_analyze
from evoros.analysis.tables.records import read_record
from evoros.plugins.recordings.bags.messages import list_messages
from evoros.plugins.recordings.missions import list_rows, read_mission
from evoros.storage.trajectory_files import trajectory_file
from evoros.terminal.console import DONE, INPUT

ALL = ("record=all", "optimizer.generations=1", "failure.latest_s=3.0")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return finished_run(tmp_path_factory.mktemp("kept") / "run", *ALL)


def place_of(row: Mapping[Hashable, Any]) -> tuple[int, int, str, int]:
    return int(row["generation"]), int(row["design"]), str(row["world"]), int(row["trial"])


@pytest.mark.slow
def test_bags_of_a_design_are_those_of_its_missions(run: Path, tmp_path: Path) -> None:
    missions = evoros.load_run(run).missions
    design = next(i for i in missions.design.unique() if i != missions.design.iloc[-1])
    given = ["bag", str(run), "--design", str(design), "--output", str(tmp_path)]
    assert evoros_analyze(given) == DONE
    rows = [row for row in missions.to_dict("records") if row["design"] == design]
    folders = sorted(path.name for path in tmp_path.iterdir() if path.is_dir())
    names = [f"bag_{place[0]:05d}_{trajectory_file(place).stem}" for place in map(place_of, rows)]
    assert folders == sorted(names)
    loaded = evoros.load_run(run)
    for row, name in zip(rows, names, strict=True):
        messages = read_mcap(tmp_path / name / f"{name}.mcap")
        odometry = (m.content for m in messages if m.topic == "/odom")
        driven = [content["pose"]["pose"]["position"]["x"] for content in odometry]
        assert driven == list(loaded.mission_trajectory(*place_of(row)).x_m)
        (urdf,) = (m.content["data"] for m in messages if m.topic == "/robot_description")
        robot = run / "trajectories" / "robots" / f"{design:06d}.urdf"
        assert urdf == robot.read_text()
        assert "/sonar_5" in channels(tmp_path / name / f"{name}.mcap")


def test_the_champions_bag_is_the_same_by_its_number(run: Path) -> None:
    record = read_record(run, "run")
    row = next(iter(list_rows(record, None, None, 0)))
    by_number = read_mission(record, row)
    champion = evoros.load_run(run).trajectory(str(row["world"]))
    pd.testing.assert_frame_equal(by_number.trajectory, champion)
    assert by_number.urdf == (run / "champion" / "robot.urdf").read_text()
    assert list_messages(by_number, "/goal")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--design", "999"), "no mission of design 999"),
        (("--trial", "77"), "change --design, --generation or --trial"),
    ],
)
def test_missions_that_do_not_exist(
    options: Sequence[str], said: str, run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert evoros_analyze(["bag", str(run), *options]) == INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line


def test_a_run_that_kept_only_the_champions_says_so(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(run, tmp_path / "run")
    shutil.rmtree(folder / "trajectories")
    manifest = folder / "manifest.json"
    manifest.write_text(manifest.read_text().replace('"record": "all"', '"record": "champion"'))
    reseal(folder)
    assert evoros_analyze(["bag", str(folder), "--design", "1"]) == INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith(
        "no trajectories of all missions (record=champion); start a run with record=all"
    )
