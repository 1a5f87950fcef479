"""Recordings, bags and videos of a design that has all types of sensors."""

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from bag_readers import ReadMessage, read_mcap, read_rosbag
from rerun.chunk import RrdReader
from sensor_runs import BUMPERS, IMU, INFRARED, LIDAR, ODOMETRY, finish_senses

from evoros.analysis.command import evoros_analyze
from evoros.analysis.tables.records import Record, read_record
from evoros.base.arrays import Array
from evoros.formats.strict_xml import parse
from evoros.formats.urdf.tree import read_tree
from evoros.plugins.recordings.missions import read_champion_mission
from evoros.plugins.recordings.video.captions import FAILED, NEAR
from evoros.plugins.recordings.video.sensors import make_views
from evoros.terminal.console import DONE

pytestmark = pytest.mark.slow

AXES = ("x", "y", "z")


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Record:
    return read_record(finish_senses(tmp_path_factory.mktemp("all") / "run"), "run")


@pytest.fixture(scope="module")
def bags(record: Record, tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("bags")
    for kind in ("mcap", "ros1"):
        given = ["bag", str(record.path), "--world", "near", "--format", kind]
        assert evoros_analyze([*given, "--output", str(output)]) == DONE
    return output


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


def test_a_bag_has_the_readings_of_all_sensors(bags: Path, record: Record) -> None:
    trajectory = record.run.trajectory("near")
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


# Videos ---------------------------------------------------------------------------------------


def test_a_video_tells_bumpers_that_are_closed_and_all_sensors_that_failed(
    record: Record,
) -> None:
    trajectory = record.run.trajectory("near")
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
