"""A recording for Rerun, read by Rerun: what it shows is what the run recorded."""

import math
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from helpers import everything, tiny
from meshed_robot import write_meshed_robot
from rerun.chunk import RrdReader
from rerun.error_utils import RerunWarning

from evoros.analysis.command import evoros_analyze
from evoros.analysis.tables.designs import select_bests, trace_fitness
from evoros.analysis.tables.records import Record, read_record
from evoros.plugins.recordings.missions import RecordedMission, read_champion_mission
from evoros.plugins.recordings.rerun import subcommand
from evoros.plugins.recordings.rerun.robot import MOST_RAYS, draw_rays, find_changes
from evoros.plugins.recordings.video.captions import FAILED
from evoros.plugins.recordings.video.scene import ShownRobot
from evoros.plugins.recordings.video.sensors import SILENT_M, FieldOfView
from evoros.terminal.console import DONE, INPUT

TIME, GENERATION = "mission_time", "generation"
SINGLE = 1e-5
"""Recordings have numbers of single precision."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    top = tmp_path_factory.mktemp("rerun")
    own = (f"robot.description={write_meshed_robot(top / 'robot')}", "robot=own", "design=around")
    more = ("failure.latest_s=3.0", "optimizer.generations=2", "~world.far")
    assert tiny(top / "run", *own, *more) == DONE
    return top / "run"


@pytest.fixture(scope="module")
def record(run: Path) -> Record:
    return read_record(run, "run")


@pytest.fixture(scope="module")
def mission(record: Record) -> RecordedMission:
    return read_champion_mission(record, "near")


class Recorded:
    """The entities of a recording, each with the rows of its components."""

    def __init__(self, path: Path) -> None:
        self.reader = RrdReader(path)
        self.batches: dict[str, list[Any]] = {}
        for chunk in self.reader.stream().to_chunks():
            self.batches.setdefault(chunk.entity_path, []).append(chunk.to_record_batch())

    def rows(self, path: str, component: str, timeline: str = "") -> list[tuple[float, Any]]:
        """Times and values of a component; the time of what is always there is NaN."""
        found: list[tuple[float, Any]] = []
        for batch in self.batches.get(path, []):
            names = {TIME, GENERATION} & {*batch.schema.names}
            if component in batch.schema.names and names == {timeline} - {""}:
                values = batch.column(component).to_pylist()
                found += zip(_times(batch, timeline), values, strict=True)
        return sorted(found, key=lambda row: row[0])

    def mesh(self, path: str) -> tuple[np.ndarray, np.ndarray]:
        """Corners (n, 3) and colours (n, 3) of a mesh."""
        ((_, corners),) = self.rows(path, "Mesh3D:vertex_positions")
        ((_, colours),) = self.rows(path, "Mesh3D:vertex_colors")
        rgb = [[colour >> shift & 255 for shift in (24, 16, 8)] for colour in colours]
        return np.array(corners), np.array(rgb)


def _times(batch: Any, timeline: str) -> Iterator[float]:
    if not timeline:
        yield from [math.nan] * batch.num_rows
        return
    column = batch.column(timeline)
    seconds = 1e9 if str(column.type).startswith("duration") else 1
    yield from (int(value) / seconds for value in column.cast("int64").to_pylist())


@pytest.fixture(scope="module")
def recorded(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    output = tmp_path_factory.mktemp("out")
    with warnings.catch_warnings():
        warnings.simplefilter("error", RerunWarning)  # else it warns of what it leaves out
        assert evoros_analyze(["rerun", str(run), "--output", str(output)]) == DONE
    assert [path.name for path in output.iterdir()] == ["rerun.rrd"]
    return Recorded(output / "rerun.rrd")


def test_the_robot_is_where_the_trajectory_says(
    recorded: Recorded, mission: RecordedMission
) -> None:
    rows = mission.trajectory
    places = recorded.rows("/near/robot", "Transform3D:translation", TIME)
    turns = recorded.rows("/near/robot", "Transform3D:quaternion", TIME)
    assert [time for time, _ in places] == pytest.approx(rows["time_s"].tolist())
    x, y, z = np.array([place for _, (place,) in places]).T
    assert x == pytest.approx(rows["x_m"].to_numpy(), abs=SINGLE)
    assert y == pytest.approx(rows["y_m"].to_numpy(), abs=SINGLE)
    assert not z.any()
    half = rows["yaw_rad"].to_numpy() / 2
    for (_, (turn,)), expected in zip(turns, half, strict=True):
        same = abs(turn[2] * math.sin(expected) + turn[3] * math.cos(expected))
        assert same == pytest.approx(1.0, abs=SINGLE)


def test_every_link_shows_its_mesh_in_its_colours(
    recorded: Recorded, mission: RecordedMission
) -> None:
    robot = ShownRobot(mission.loaded_urdf)
    sensors = {sensor.link for sensor in mission.sensors}
    bodies = {link for link, s in robot.surfaces.items() if len(s.normals)} - sensors
    assert bodies >= {"base_link", "left", "right"}
    for link in bodies:
        corners, colours = recorded.mesh(f"/near/robot/links/{link}")
        surface = robot.surfaces[link]
        assert corners == pytest.approx(surface.corners[:, :3], abs=SINGLE)
        assert colours / 255 == pytest.approx(np.repeat(surface.colours, 3, axis=0), abs=0.003)
    for link in sensors:
        assert recorded.rows(f"/near/robot/links/{link}", "Mesh3D:vertex_positions")


def test_wheels_turn_and_nothing_that_moves_has_a_pose_at_all_times(recorded: Recorded) -> None:
    """Rerun prefers what is there at all times."""
    for wheel in ("left", "right"):
        path = f"/near/robot/links/{wheel}"
        turns = [turn for _, turn in recorded.rows(path, "Transform3D:quaternion", TIME)]
        assert len({tuple(turn[0]) for turn in turns}) > 10
        assert not recorded.rows(path, "Transform3D:quaternion")


def test_every_sensor_has_rays_as_long_as_its_readings(
    recorded: Recorded, mission: RecordedMission
) -> None:
    times = mission.trajectory["time_s"].to_numpy()
    assert len(mission.sensors) == 6
    for sensor in mission.sensors:
        path = f"/near/robot/rays/{sensor.link}"
        assert recorded.rows(path, "Transform3D:translation")
        shown = recorded.rows(path, "LineStrips3D:strips", TIME)
        assert shown[0][0] == times[0]
        for time, strips in shown:
            reading = float(sensor.readings[np.searchsorted(times, time - 1e-9), 0])
            reach = SILENT_M if math.isnan(reading) else reading
            ends = np.linalg.norm(np.array(strips[0])[1:-1], axis=1)
            assert ends == pytest.approx(np.full(len(ends), reach), abs=1e-4)
        readings = recorded.rows(f"/near/readings/{sensor.link}", "Scalars:scalars", TIME)
        changes = find_changes(sensor.readings)
        assert [time for time, _ in readings] == pytest.approx(times[changes].tolist())
        values = np.array([value[0] for _, value in readings])
        np.testing.assert_array_equal(values, sensor.readings[changes, 0])


def test_a_faulty_sensor_is_marked_from_its_failure_on(
    recorded: Recorded, mission: RecordedMission
) -> None:
    failures = mission.faults
    assert failures
    grey = FAILED[0] << 24 | FAILED[1] << 16 | FAILED[2] << 8 | 255
    marks = recorded.rows("/near/robot/faults", "Points3D:labels", TIME)
    assert [time for time, _ in marks] == pytest.approx(sorted(t for _, t, _ in failures))
    told = recorded.rows("/near/events", "TextLog:text", TIME)
    for sensor, at_s, _ in failures:
        link = mission.sensors[sensor].link
        assert any(link in label for label in marks[-1][1])
        assert [t for t, (text,) in told if text.startswith(f"{link}:")] == pytest.approx([at_s])
        rays = recorded.rows(f"/near/robot/rays/{link}", "LineStrips3D:colors", TIME)
        bodies = recorded.rows(f"/near/robot/links/{link}", "Mesh3D:albedo_factor", TIME)
        for rows in (rays, bodies):
            after = [colours for time, colours in rows if time >= at_s]
            assert after
            assert {colour for colours in after for colour in colours} == {grey}


def test_the_world_and_the_course_are_there(recorded: Recorded, mission: RecordedMission) -> None:
    parts = {path for path in recorded.batches if path.startswith("/near/world/")}
    assert parts >= {"/near/world/ground", "/near/world/movable"}
    corners, _ = recorded.mesh("/near/world/movable")
    low, high = corners.min(axis=0), corners.max(axis=0)
    for body in mission.world.obstacles:
        assert (np.array(body.pose.position) > low).all()
        assert (np.array(body.pose.position) < high).all()
    ((_, strips),) = recorded.rows("/near/course/route", "LineStrips3D:strips")
    assert np.array(strips[0])[1:, :2] == pytest.approx(mission.route, abs=SINGLE)
    ((_, path),) = recorded.rows("/near/path", "LineStrips3D:strips")
    places = mission.trajectory[["x_m", "y_m"]].to_numpy()
    assert np.array(path[0])[:, :2] == pytest.approx(places, abs=SINGLE)


def test_generations_have_their_fitness_and_the_sensors_of_their_best(
    recorded: Recorded, record: Record
) -> None:
    table: pd.DataFrame = record.run.generations
    best = trace_fitness(table)["recorded"]
    shown = recorded.rows("/evolution/fitness/recorded", "Scalars:scalars", GENERATION)
    assert shown == [(generation, [value]) for generation, value in best.items()]
    ((_, (champion,)),) = recorded.rows(
        "/evolution/fitness/champion", "Scalars:scalars", GENERATION
    )
    assert champion == record.run.status["best_fitness"]
    fans = recorded.rows("/evolution/best/sensors", "LineStrips3D:strips", GENERATION)
    assert [len(strips) for _, strips in fans] == [6] * len(best)
    texts = recorded.rows("/evolution/text", "TextDocument:text", GENERATION)
    for (_, (text,)), design in zip(texts, select_bests(table)["id"], strict=True):
        assert f"design {design}" in text
    assert recorded.mesh("/evolution/best/robot/base_link")[0].size


def test_nothing_has_the_time_of_day(recorded: Recorded) -> None:
    names = {n for rows in recorded.batches.values() for b in rows for n in b.schema.names}
    timelines = {name for name in names if ":" not in name and not name.startswith("rerun.")}
    assert timelines == {TIME, GENERATION}
    assert "/__properties" not in recorded.batches
    assert len(recorded.reader.blueprints()) == 1


def test_the_same_run_gives_the_same_data(run: Path, recorded: Recorded, tmp_path: Path) -> None:
    before = everything(run)
    assert evoros_analyze(["rerun", str(run), "--output", str(tmp_path)]) == DONE
    assert everything(run) == before
    again = Recorded(tmp_path / "rerun.rrd")
    assert again.reader.recordings()[0].recording_id == "run"

    def collect(recording: Recorded) -> dict[str, set[str]]:
        """Return the chunks of each entity, in any order and without the ids of rows."""
        return {
            path: {
                repr(batch.drop_columns(["rerun.controls.RowId"]).to_pydict()) for batch in batches
            }
            for path, batches in recording.batches.items()
        }

    assert collect(again) == collect(recorded)


def test_a_scan_has_few_rays_that_end_at_its_readings() -> None:
    bearings = np.radians(np.linspace(-90.0, 90.0, 181))
    ranges = np.linspace(1.0, 2.0, 181)
    lines = draw_rays(ranges, bearings, FieldOfView(np.eye(4), math.pi / 2, 3.0))
    assert MOST_RAYS / 2 <= len(lines) <= MOST_RAYS
    step = 181 // len(lines) + 1
    for line, reading, bearing in zip(lines, ranges[::step], bearings[::step], strict=True):
        end = (reading * math.cos(bearing), reading * math.sin(bearing), 0.0)
        assert line[0].tolist() == [0.0, 0.0, 0.0]
        assert tuple(line[1]) == pytest.approx(end)


def test_changes_of_unknown_values_are_none() -> None:
    rows = np.array([[1.0, math.nan], [1.0, math.nan], [1.0, 2.0], [1.0, 2.0], [math.nan, 2.0]])
    assert find_changes(rows) == [0, 2, 4]


def test_too_large_a_recording_is_one_line(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(subcommand, "MAX_BYTES", 1000)
    assert evoros_analyze(["rerun", str(run), "--output", str(tmp_path / "out")]) == INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert "choose fewer missions with --world, --generation or --trial" in line
    assert not (tmp_path / "out").exists()


def test_without_rerun_one_line_says_what_to_install(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in [
        name for name in sys.modules if name.startswith("evoros.plugins.recordings.rerun.")
    ]:
        if name != subcommand.__name__:
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert evoros_analyze(["rerun", str(run)]) == INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("pip install 'evoros[rerun]'")
