"""A deployed package describes all types of sensors, and the field of view of each."""

from pathlib import Path

import pytest
import yaml
from helpers import finished_run
from sensor_runs import (
    BUMPERS,
    IMU,
    INFRARED,
    LIDAR,
    ODOMETRY,
    VIEWS,
    WIDE,
    finish_senses,
    read_widths,
)

from evoros.analysis.command import evoros_analyze
from evoros.analysis.tables.records import read_record
from evoros.plugins.deploy.champion import read_champion
from evoros.plugins.deploy.parameters import list_range_finders, robot_parameters
from evoros.plugins.deploy.subcommand import plan_mounting
from evoros.terminal.console import DONE

pytestmark = pytest.mark.slow


def test_a_deployed_package_tells_of_all_sensors_as_in_a_mission(tmp_path: Path) -> None:
    champion = read_champion(read_record(finish_senses(tmp_path / "run"), "run"))
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


def test_a_package_and_its_drawing_state_the_field_of_view_of_each_sensor(tmp_path: Path) -> None:
    run = finished_run(tmp_path / "run", *VIEWS)
    assert evoros_analyze(["deploy", str(run), "--output", str(tmp_path / "src")]) == DONE
    (package,) = (tmp_path / "src").iterdir()
    (parameters,) = yaml.safe_load((package / "config" / "robot.yaml").read_text()).values()
    told = parameters["ros__parameters"]["evoros"]
    assert list(read_widths(told.values())) == pytest.approx([*WIDE.values()])
    lines = (package / "README.md").read_text().splitlines()
    rows = [line.split("|") for line in lines if line.startswith(tuple(f"| `{w}_" for w in WIDE))]
    assert [float(row[7]) for row in rows] == [*WIDE.values()]
    plan = plan_mounting(read_champion(read_record(run, "run")))
    assert [sensor.fov_deg for sensor in plan.sensors] == [*WIDE.values()]
