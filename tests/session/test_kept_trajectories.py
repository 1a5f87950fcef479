"""The key ``record``: whose trajectories a folder keeps, whatever happens to the run."""

import csv
from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from helpers import USER_PARTS, content, copied, cut, everything, reseal, resume, scored, tiny

import evoros
from evoros.analysis.command import evoros_analyze
from evoros.analysis.subcommands import SUBCOMMANDS
from evoros.config.compose import compose
from evoros.dispatch.dispatcher import Dispatcher
from evoros.mission.mission import TRAJECTORY
from evoros.storage.creation import create_folder
from evoros.storage.digests import ignore
from evoros.storage.mission_log import MissionLog
from evoros.storage.mission_table import begin_table
from evoros.storage.tables import trajectory_table
from evoros.storage.trajectory_files import trajectory_file, world_file
from evoros.terminal.console import DONE, INPUT

ALL = ("record=all", "optimizer.generations=1", "failure.latest_s=3.0")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run that keeps all, in which no mission is run for its trajectory."""
    folder = tmp_path_factory.mktemp("kept") / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Dispatcher, "run_for_trajectories", None)
        assert tiny(folder, *ALL) == DONE
    return folder


def keys(folder: Path) -> list[tuple[int, int, str, int]]:
    with (folder / "missions.csv").open() as file:
        rows = list(csv.DictReader(file))
    return [(int(r["generation"]), int(r["design"]), r["world"], int(r["trial"])) for r in rows]


def place_of(row: Mapping[Hashable, Any]) -> tuple[int, int, str, int]:
    return int(row["generation"]), int(row["design"]), str(row["world"]), int(row["trial"])


def kept(folder: Path) -> dict[str, bytes]:
    return everything(folder / "trajectories")


def test_each_mission_has_its_trajectory(run: Path) -> None:
    loaded = evoros.load_run(run)
    files = sorted(path.relative_to(run) for path in (run / "trajectories").glob("0*/*.csv"))
    assert files == [trajectory_file(key) for key in sorted(keys(run))]
    for row in loaded.missions.to_dict("records"):
        last = loaded.mission_trajectory(*place_of(row)).iloc[-1]
        assert (last.time_s, last.visited) == (row["time_s"], row["visited"])


def test_a_kept_trajectory_is_that_of_the_mission_run_again(run: Path) -> None:
    place = keys(run)[-1]
    _, again = evoros.replay(run, place, config_dir=USER_PARTS)
    table = evoros.load_run(run).mission_trajectory(*place)
    assert list(table) == list(again)
    np.testing.assert_array_equal(table.to_numpy(float), again.to_numpy(float))


def test_the_champion_and_the_missions_are_those_of_any_run(run: Path, tmp_path: Path) -> None:
    assert tiny(tmp_path / "run", *ALL[1:]) == DONE
    assert content(tmp_path / "run") == content(run)
    assert not (tmp_path / "run" / "trajectories").exists()


@pytest.mark.slow
def test_a_run_that_was_cut_goes_on_to_the_same_bytes_on_two_workers(
    run: Path, tmp_path: Path
) -> None:
    """One trajectory is lost besides, as a loss of power can do."""
    folder = copied(run, tmp_path / "run")
    lines = (run / "missions.csv").read_bytes().splitlines(keepends=True)
    cut(folder, len(b"".join(lines[:5])))
    _, *done = keys(folder)
    for key in set(keys(run)) - set(done):
        (folder / trajectory_file(key)).unlink()
    assert done
    assert resume(folder, "executor=processes", "executor.workers=2") == DONE
    assert content(folder) == content(run)
    assert kept(folder) == kept(run)


def test_a_deleted_trajectory_comes_back_alone(run: Path, tmp_path: Path) -> None:
    folder = copied(run, tmp_path / "run")
    (folder / trajectory_file(keys(folder)[3])).unlink()
    before = (folder / "missions.csv").read_bytes()
    assert resume(folder) == DONE
    assert kept(folder) == kept(run)
    assert (folder / "missions.csv").read_bytes() == before


def test_a_mission_that_comes_back_otherwise_is_refused(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(run, tmp_path / "run")
    (folder / trajectory_file(keys(folder)[0])).unlink()
    with (folder / "missions.csv").open() as file:
        header, first, *rest = csv.reader(file)
    first[header.index("max_speed_mps")] = "9.75"
    with (folder / "missions.csv").open("w") as file:
        csv.writer(file, lineterminator="\n").writerows([header, first, *rest])
    reseal(folder)
    assert resume(folder) == INPUT
    line = capsys.readouterr().err.splitlines()[-1]
    assert "an outcome that differs from the recorded one" in line


@pytest.mark.slow
def test_a_run_may_keep_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "run"
    assert tiny(folder, "record=none", "optimizer.generations=1", "figures=[mission]") == DONE
    assert not [name for name in everything(folder) if "trajector" in name]
    warnings = [line for line in capsys.readouterr().err.splitlines() if "record=none" in line]
    assert len(warnings) == 1
    for subcommand in SUBCOMMANDS.keys() & {"mission", "video", "bag"}:
        assert evoros_analyze([subcommand, str(folder), "--output", str(tmp_path)]) == INPUT
        (line,) = capsys.readouterr().err.splitlines()
        assert line.endswith("no trajectories (record=none); start a run with record=champion")
    before = everything(folder / "champion")
    assert resume(folder) == DONE
    assert everything(folder / "champion") == before


def test_an_evaluation_keeps_all_if_told(run: Path, tmp_path: Path) -> None:
    folder = scored(tmp_path / "all", run, "record=all", "trials=2")
    wanted = [(0, 0, world, trial) for world in ("far", "near") for trial in (0, 1)]
    assert all((folder / trajectory_file(key)).is_file() for key in wanted)
    urdf = (run / "champion" / "robot.urdf").read_bytes()
    assert (folder / "trajectories" / "robots" / "000000.urdf").read_bytes() == urdf


def test_a_world_of_its_own_in_each_mission_is_kept_with_it(tmp_path: Path) -> None:
    given = ["world=generated", "world.generated.renew=true", "simulator=planar"]
    experiment = compose([*given, "executor=serial"]).build()
    create_folder(tmp_path, {"config.yaml": "", "missions.csv": begin_table([])})
    scenario, files = experiment.scenario, MissionLog(tmp_path, [], ignore).trajectories
    design = experiment.space.decode(np.full(experiment.space.size, 0.5))
    missions = experiment.plan.selection(0, 7, design), experiment.plan.selection(1, 7, design)
    readings = [np.nan, 1.5, 0.5, 1.0 / 3, 4.5, 4.5]
    trajectory = np.array([[0.0] * 9 + readings, [0.25] * 6 + [2.0, 0.0, 1.0] + readings[::-1]])
    for (mission,) in missions:
        files.keep(scenario, mission, trajectory)
        sdf = (tmp_path / world_file("generated", mission.draws)).read_text()
        assert sdf == scenario.world["generated"].at(mission.draws).sdf
        assert files.has(mission)
        np.testing.assert_array_equal(files.read(mission), trajectory)
    assert len(list((tmp_path / "trajectories" / "worlds").iterdir())) == 2


def test_a_table_read_back_is_written_the_same(run: Path) -> None:
    """So the champion's files are those of its missions, byte for byte."""
    for path in sorted((run / "trajectories").glob("0*/*.csv"))[:3]:
        table = pd.read_csv(path)
        readings = [str(name) for name in list(table)[len(TRAJECTORY) :]]
        assert readings == [f"range_{index}_m" for index in range(len(readings))]
        assert trajectory_table(table.to_numpy(float), list(map(str, table))) == path.read_text()
