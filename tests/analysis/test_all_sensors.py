"""Figures, players and bags of a design that has all types of sensors."""

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from bag_readers import ReadMessage, read_mcap, read_rosbag
from helpers import finished_run
from matplotlib.collections import PolyCollection
from rerun.chunk import RrdReader

from evoros.analysis.command import evoros_analyze
from evoros.analysis.drawing.robot import Champions
from evoros.analysis.figures.mission import Missions, draw_missions
from evoros.analysis.figures.overlay import count_coverage, draw_overlay
from evoros.analysis.figures.panel import draw_panels, rank_pairs
from evoros.analysis.report.playback import encode_playback
from evoros.analysis.tables.agents import read_tracks
from evoros.analysis.tables.champions import (
    read_champion,
    read_champion_sensors,
    read_champion_signals,
)
from evoros.analysis.tables.designs import read_initial_sensors
from evoros.analysis.tables.readings import read_traces
from evoros.analysis.tables.records import Record, read_record
from evoros.analysis.tables.study import Study
from evoros.analysis.tables.tracks import TOUCHED, load_champion_world
from evoros.base.arrays import Array
from evoros.formats.strict_xml import parse
from evoros.formats.urdf.tree import read_tree
from evoros.plugins.deploy.champion import read_champion as deploy_champion
from evoros.plugins.deploy.parameters import list_range_finders, robot_parameters
from evoros.plugins.deploy.subcommand import plan_mounting
from evoros.plugins.recordings.missions import read_champion_mission
from evoros.plugins.recordings.video.captions import FAILED, NEAR
from evoros.plugins.recordings.video.sensors import make_views
from evoros.terminal.console import DONE

pytestmark = pytest.mark.slow

ALL = (
    "seed=1",
    "design=senses",
    "simulator=mujoco",
    "~world.far",
    "world.near.course.end_on_collision=false",
    "world.near.course.time_limit_s=25.0",
    "world.near.course.waypoints=[[-1.0,-7.8]]",  # behind a box
    "controller/avoidance=blind",
    "optimizer.generations=1",
    "optimizer.population_size=2",
    "optimizer.validation_trials=0",
    "failure.earliest_s=0.5",
    "failure.latest_s=6.0",
)
BUMPERS, IMU, INFRARED, LIDAR, ODOMETRY = (0, 1), 2, (3, 4), 5, 6
AXES = ("x", "y", "z")


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Record:
    return read_record(finished_run(tmp_path_factory.mktemp("all") / "run", *ALL), "run")


@pytest.fixture(scope="module")
def trajectory(record: Record) -> pd.DataFrame:
    table: pd.DataFrame = record.run.trajectory("near")
    return table


@pytest.fixture(scope="module")
def bags(record: Record, tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("bags")
    for kind in ("mcap", "ros1"):
        given = ["bag", str(record.path), "--world", "near", "--format", kind]
        assert evoros_analyze([*given, "--output", str(output)]) == DONE
    return output


# Tables ---------------------------------------------------------------------------------------


def test_sensors_keep_their_numbers_and_pairs(record: Record) -> None:
    seeing, others = read_champion_sensors(record), read_champion_signals(record)
    assert seeing["sensor"].tolist() == [*INFRARED, LIDAR]
    assert others["sensor"].tolist() == [*BUMPERS, IMU, ODOMETRY]
    pairs = seeing["pair"].tolist()
    assert pairs[0] == pairs[1] != pairs[2]  # only placed sensors have twins
    evolved = record.run.genes.set_index("gene")["value"]
    assert seeing["range_m"].tolist() == [evolved["reach"]] * 2 + [8.0]
    assert others["width_m"].tolist() == [evolved["width"]] * 2 + [0.0, 0.0]


def test_random_designs_have_the_ranges_that_they_drew_and_the_fixed_sensors(
    record: Record,
) -> None:
    table = record.run.generations
    drawn = table[table.generation == 0].set_index("id")["reach"]
    sensors = read_initial_sensors(record)
    infrared = sensors[sensors["type"] == "infrared"]
    assert drawn.nunique() > 1
    np.testing.assert_array_equal(infrared["range_m"], drawn[infrared["design"]])
    assert (sensors[sensors["type"] == "lidar"].groupby("design")["sensor"].sum() == LIDAR).all()


# Recordings for Rerun ------------------------------------------------------------------------


def test_a_recording_has_the_readings_of_all_sensors_and_the_rays_of_those_that_see(
    record: Record, tmp_path: Path
) -> None:
    assert evoros_analyze(["rerun", str(record.path), "--output", str(tmp_path)]) == DONE
    paths = {chunk.entity_path for chunk in RrdReader(tmp_path / "rerun.rrd").stream().to_chunks()}
    readings, rays = (
        {int(path.rpartition("_")[2]) for path in paths if path.startswith(f"/near/{group}/")}
        for group in ("readings", "robot/rays")
    )
    assert readings == {*BUMPERS, IMU, *INFRARED, LIDAR, ODOMETRY}
    assert rays == {*INFRARED, LIDAR}


# Bags -----------------------------------------------------------------------------------------


def on(topic: str, messages: list[ReadMessage]) -> list[dict[str, Any]]:
    return [message.content for message in messages if message.topic == topic]


def columns(table: pd.DataFrame, *names: str) -> Array:
    """The readings at the decisions, without silent ones."""
    values = table[list(names)].to_numpy(float)[:-1]
    heard: Array = values[np.isfinite(values).all(axis=1)]
    return heard


def vector(values: Mapping[str, float]) -> list[float]:
    return [values[axis] for axis in AXES]


def test_a_bag_has_the_readings_of_all_sensors(bags: Path, trajectory: pd.DataFrame) -> None:
    messages = read_mcap(bags / "bag_near" / "bag_near.mcap")
    for sensor in BUMPERS:
        told = [message["data"] for message in on(f"/bumper_{sensor}", messages)]
        assert told == (columns(trajectory, f"touch_{sensor}")[:, 0] > 0).tolist()
    imu = on(f"/imu_{IMU}", messages)
    rates = [f"rate_{axis}_{IMU}_radps" for axis in AXES]
    felt = [f"acceleration_{axis}_{IMU}_mps2" for axis in AXES]
    result = [vector(m["angular_velocity"]) + vector(m["linear_acceleration"]) for m in imu]
    np.testing.assert_array_equal(result, columns(trajectory, *rates, *felt))
    assert {m["orientation_covariance"][0] for m in imu} == {-1.0}  # no orientation
    wheels = on(f"/odometry_{ODOMETRY}", messages)
    result = [[m["twist"]["linear"]["x"], m["twist"]["angular"]["z"]] for m in wheels]
    expected = columns(trajectory, f"speed_{ODOMETRY}_mps", f"yaw_rate_{ODOMETRY}_radps")
    np.testing.assert_array_equal(result, expected)
    for sensor in INFRARED:
        ranges = on(f"/infrared_{sensor}", messages)
        expected = columns(trajectory, f"range_{sensor}_m")[:, 0]
        np.testing.assert_array_equal([m["range"] for m in ranges], expected.astype(np.float32))
        assert {m["radiation_type"] for m in ranges} == {1}
    scans = on(f"/lidar_{LIDAR}", messages)
    expected = columns(trajectory, *(f"range_{LIDAR}_{k}_m" for k in range(24)))
    np.testing.assert_array_equal([m["ranges"] for m in scans], expected.astype(np.float32))
    assert scans[0]["angle_max"] - scans[0]["angle_min"] == pytest.approx(math.pi)
    frames = {(t, m["header"]["frame_id"]) for t, _, m in messages if "header" in m}
    assert {(f"/{name}", name) for name in (f"imu_{IMU}", f"odometry_{ODOMETRY}")} <= frames


@pytest.mark.ros(1)
def test_a_bag_of_ros_1_has_the_same_readings(bags: Path) -> None:
    first, _ = read_rosbag(bags / "bag_near.bag")
    second = read_mcap(bags / "bag_near" / "bag_near.mcap")
    for topic in ("/bumper_0", f"/imu_{IMU}", f"/odometry_{ODOMETRY}", f"/lidar_{LIDAR}"):
        assert on(topic, first) == on(topic, second)
        assert on(topic, first)


# Figures --------------------------------------------------------------------------------------


def test_figures_of_designs_draw_the_place_of_each_sensor_and_the_zones_of_bumpers(
    record: Record,
) -> None:
    study = Study((record,))
    sensors, contexts = study.gather(read_champion), {record.treatment: record.context}
    cover = count_coverage(sensors, contexts, (0.5,))
    over = draw_overlay(cover, Champions(sensors, contexts, study.signals))
    single = draw_panels(rank_pairs(sensors), contexts, signals=study.signals)
    width = float(record.run.genes.set_index("gene")["value"]["width"])
    for figure in (over, single):
        hatched = [
            artist
            for artist in figure.axes[0].collections
            if isinstance(artist, PolyCollection) and artist.get_hatch()
        ]
        (zones,) = hatched
        front, left = (
            np.asarray(path.vertices)[:4] for path in zones.get_paths()
        )  # y across, x up
        assert np.ptp(front[:, 0]) == pytest.approx(width)  # faces ahead
        assert np.ptp(left[:, 1]) == pytest.approx(width)  # faces left
        assert front[:, 1].max() > 0.25 > front[:, 1].min()
        texts = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
        assert {"bumper (zone)", "imu", "odometry", "infrared", "lidar"} <= {*texts}


def test_the_map_of_a_mission_has_the_bumpers_that_closed(
    record: Record, trajectory: pd.DataFrame
) -> None:
    table = read_tracks(record, "near")
    begins = [
        (row, sensor)
        for sensor in BUMPERS
        for row in np.flatnonzero(np.diff(trajectory[f"touch_{sensor}"], prepend=0.0) > 0).tolist()
    ]
    assert begins, "the robot met nothing, which would show little"
    told = [(row, int(n)) for row, cell in enumerate(table[TOUCHED]) for n in cell.split(";") if n]
    assert sorted(told) == sorted(begins)
    worlds = {"near": load_champion_world(record.run, record.context, "near")}
    (axes,) = draw_missions(Missions(table, worlds, record.context.modes)).axes
    (marks,) = (line for line in axes.lines if line.get_marker() == "s")
    places = table[["x_m", "y_m"]].to_numpy(float)[sorted({row for row, _ in begins})]
    np.testing.assert_array_equal(np.asarray(marks.get_xydata()), places)


def test_what_imus_odometry_and_bumpers_read_is_drawn_over_time(
    record: Record, trajectory: pd.DataFrame, tmp_path: Path
) -> None:
    worlds = {"near": load_champion_world(record.run, record.context, "near")}
    table = read_tracks(record, "near")
    traces = {"near": read_traces(record, "near")}
    map_alone = draw_missions(Missions(table, worlds, record.context.modes))
    figure = draw_missions(Missions(table, worlds, record.context.modes, traces=traces))
    assert len(map_alone.axes) == 1
    axes = {artist.get_ylabel(): artist for artist in figure.axes[1:]}
    assert list(axes) == ["closed", "rate\n[rad/s]", "acceleration\n[m/s²]", "speed\n[m/s]"]
    rates = [f"rate_z_{IMU}_radps", f"yaw_rate_{ODOMETRY}_radps"]
    for line, column in zip(axes["rate\n[rad/s]"].lines, rates, strict=False):
        np.testing.assert_array_equal(line.get_ydata(), trajectory[column].to_numpy(float))
    assert len(axes["closed"].collections) == len(BUMPERS)
    failed = {trace.label for trace in traces["near"] if math.isfinite(trace.failed_s)}
    marks = sum(line.get_marker() == "^" for artist in axes.values() for line in artist.lines)
    assert marks == len(failed)
    given = ["mission", str(record.path), "--readings", "--world", "near", "--output"]
    assert evoros_analyze([*given, str(tmp_path)]) == DONE


def test_the_page_plays_what_each_sensor_read_and_when_it_failed(
    record: Record, trajectory: pd.DataFrame
) -> None:
    content = json.loads(encode_playback(record))
    assert [artist["number"] for artist in content["sensors"]] == [*INFRARED, LIDAR]
    shown = content["signals"]
    assert [artist["number"] for artist in shown] == [*BUMPERS, IMU, ODOMETRY]
    assert [artist["touches"] for artist in shown] == [True, True, False, False]
    mission = next(artist for artist in content["missions"] if artist["world"] == "near")
    for sensor, channels in zip(shown, mission["signals"], strict=True):
        for (name, unit), differences in zip(sensor["channels"], channels, strict=True):
            column = f"{name}_{sensor['number']}" + (f"_{unit}" if unit else "")
            assert None not in differences or trajectory[column].isna().any()
            read = np.cumsum([artist or 0 for artist in differences]) / 1000
            known = np.array([artist is not None for artist in differences])
            expected = trajectory[column].to_numpy(float)[known]
            np.testing.assert_allclose(read[known], expected, atol=5.1e-4)
    (failed,) = mission["failed"]
    assert failed["sensor"] in range(7)


def test_a_deployed_package_tells_of_all_sensors_as_in_a_mission(record: Record) -> None:
    champion = deploy_champion(record)
    links = [f"bumper_{n}" for n in BUMPERS] + [f"imu_{IMU}"]
    links += [f"infrared_{n}" for n in INFRARED] + [f"lidar_{LIDAR}", f"odometry_{ODOMETRY}"]
    told = robot_parameters(champion)[0]["evoros"]
    assert told["sensors"] == [sensor.link for sensor in champion.sensors] == links
    assert told[f"imu_{IMU}"]["measures"] == "motion"
    assert len(told[f"imu_{IMU}"]["channels"]) == 6
    assert len(told[f"lidar_{LIDAR}"]["bearings_rad"]) == 24
    assert told["infrared_3"]["radiation"] == "infrared"
    assert [finder.link for finder in list_range_finders(champion.sensors, (0, 0, 0))] == [
        f"infrared_{n}" for n in INFRARED
    ]
    assert [sensor.name for sensor in plan_mounting(champion).sensors] == links


def test_a_video_tells_bumpers_that_are_closed_and_all_sensors_that_failed(
    record: Record, trajectory: pd.DataFrame
) -> None:
    mission = replace(read_champion_mission(record, "near"), near_m=0.5)
    robot = read_tree(parse(mission.urdf.encode(), "r"), "r")
    times, rows = trajectory["time_s"].to_numpy(float), np.arange(len(trajectory))
    for sensor, shown in enumerate(make_views(robot, mission, times, rows)):
        assert (shown.view is not None) == (sensor in (*INFRARED, LIDAR))
        failed, near = (np.all(shown.colours == colour, axis=1) for colour in (FAILED, NEAR))
        recorded = mission.sensors[sensor].readings
        assert failed.tolist() == np.isnan(recorded).all(axis=1).tolist()
        if sensor in BUMPERS:
            assert near.tolist() == (recorded[:, 0] > 0.0).tolist()
        elif sensor in (IMU, ODOMETRY):
            assert not near.any()
