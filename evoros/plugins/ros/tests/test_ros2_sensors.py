"""A node of ROS 2 drives by a scan, and hears all types of sensors as messages of their own."""

import json
import math
from typing import Any

import numpy as np
import pytest
from helpers import ROOT
from needs import ROS2_PYTHON
from nodes.scan import NEAR_M, SPEED_MPS, steer
from robot_cases import load
from sensor_cases import equip, react
from world_cases import GROUND, box, square, world_of

from evoros.base.arrays import COMMAND_SIZE, CONTACT, Array
from evoros.controller.protocol import Briefing
from evoros.plugins.ros.ros_controller import Ros2
from evoros.robot.model import Robot
from evoros.sensor.bumper import Bumper
from evoros.sensor.imu import Imu
from evoros.sensor.infrared import Infrared
from evoros.sensor.lidar import Lidar
from evoros.sensor.odometry import Odometry
from evoros.sensor.protocol import Sensor
from evoros.simulator.planar import Planar

pytestmark = pytest.mark.ros(2)
TICKS, BEAMS = 150, 37
BLOCKS = box("left", 2.5, 0.4, 0.5), box("right", 3.5, -1.5, 0.5)
WORLD = world_of(GROUND, *BLOCKS, course=square(home_yaw_rad=0.0))


@pytest.fixture(scope="module")
def robot() -> Robot:
    lidar = Lidar(fov_deg=180.0, beams=BEAMS, range_max_m=6.0)
    types: dict[str, Sensor] = {
        "lidar": lidar,
        "imu": Imu(),
        "odometry": Odometry(),
        "infrared": Infrared(),
        "bumper": Bumper(),
    }
    mounts = [(name, 0.2, 0.0, 0.0, 0.0) for name in types]
    return equip(load(), *mounts, **types)


@pytest.fixture(scope="module")
def mission(
    robot: Robot, tmp_path_factory: pytest.TempPathFactory
) -> tuple[list[dict[str, Any]], Array, Array, Array]:
    """The messages that the node heard in each step, the readings, the states, and its commands."""
    file, commands = tmp_path_factory.mktemp("ros2") / "heard", np.zeros((TICKS, COMMAND_SIZE))
    node = [str(ROS2_PYTHON), str(ROOT / "tests" / "nodes" / "ros2_scan.py"), str(file)]
    ros = Ros2(nodes=[node], python=str(ROS2_PYTHON), twist="steering", start_limit_s=60.0)
    route = np.array([[9.0, 0.0]])
    leg = np.array([0.0, 0.0, 9.0, 0.0])
    briefing = Briefing(robot, (0.0, 0.0, 0.0, 0.0), route, 0.3, 60.0, 1)
    with ros.launch(briefing) as pilot:

        def decide(tick: int, state: Array, readings: Array) -> tuple[float, float]:
            commands[tick] = commands[tick - 1]
            pilot.exchange(round(0.1 * tick, 9), state, leg, readings, commands[tick])
            return float(commands[tick, 0]), float(commands[tick, 1])

        readings, states = react(Planar(), robot, WORLD, decide, TICKS)
    return [json.loads(line) for line in file.read_text().splitlines()], readings, states, commands


@pytest.mark.slow
def test_the_node_drives_by_the_scan(mission: Any) -> None:
    _, readings, states, commands = mission
    bumper = readings[:, -1] > 0.0
    scans = readings[:, :BEAMS].astype(np.float32).tolist()
    expected = [steer(scan, closed) for scan, closed in zip(scans, bumper.tolist(), strict=True)]
    np.testing.assert_allclose(commands, expected, atol=1e-12)
    steered = commands[:, 1] != 0.0
    assert 0 < np.argmax(steered) < TICKS - 1
    assert min(scans[int(np.argmax(steered))]) <= NEAR_M
    assert (commands[0] == (SPEED_MPS, 0.0)).all()
    assert not states[:, CONTACT][: int(np.argmax(steered)) + 5].any()


def test_each_sensor_speaks_in_messages_of_its_own(mission: Any, robot: Robot) -> None:
    heard, readings, _, _ = mission
    assert len(heard) == TICKS
    half = math.radians(90.0)
    for step, row in zip(heard, readings, strict=True):
        scan, (imu, wheels, (infrared, touch)) = row[:BEAMS], np.split(row[BEAMS:], (6, 8))
        frame, first, last, spacing, low, high, time, ranges = step["lidar"]
        limits = [-half, half, 2 * half / (BEAMS - 1), 0.15, 6.0, 0.1]
        assert frame == "lidar_0"
        assert [first, last, spacing, low, high, time] == pytest.approx(limits, rel=1e-6)
        np.testing.assert_array_equal(ranges, scan.astype(np.float32))
        assert step["imu"] == ["imu_1", -1.0, imu.tolist()]
        assert step["odometry"] == ["odometry_2", *wheels.tolist()]
        assert step["infrared"] == ["infrared_3", True, float(np.float32(infrared))]
        assert step["bumper"] is bool(touch > 0.0)
