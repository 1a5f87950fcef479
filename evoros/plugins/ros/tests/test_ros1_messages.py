"""The messages of each kind of sensor, as ROS 1's own classes have them."""

import json
import subprocess

import pytest
import yaml
from helpers import ROOT

from evoros.plugins.ros.tests.ros1_cases import PYTHON
from evoros.plugins.ros.tests.ros_cases import NODES


@pytest.mark.ros(1)
def test_each_sensor_has_the_message_of_its_kind() -> None:
    script = NODES / "ros1_message_check.py"
    bridge = str(ROOT / "evoros" / "plugins" / "ros")
    done = subprocess.run(
        [PYTHON, str(script), bridge], check=True, capture_output=True, text=True, timeout=60
    )
    told = json.loads(done.stdout)
    kinds = {topic: value[0] for topic, value in told.items() if topic != "silent"}
    sensors = {
        "/sonar_0": "Range", "/infrared_1": "Range", "/lidar_2": "LaserScan", "/imu_3": "Imu",
        "/odometry_4": "TwistStamped", "/bumper_5": "Bool",
    }  # fmt: skip
    assert kinds.items() >= sensors.items()
    texts = {topic: yaml.safe_load(told[topic][1]) for topic in sensors}
    assert [texts[f"/{name}"]["radiation_type"] for name in ("sonar_0", "infrared_1")] == [0, 1]
    imu = texts["/imu_3"]
    assert imu["header"]["frame_id"] == "imu_3"
    assert list(imu["angular_velocity"].values()) == [1.0, 2.0, 3.0]
    assert list(imu["linear_acceleration"].values()) == [4.0, 5.0, 6.0]
    assert imu["orientation_covariance"][0] == -1.0
    twist = texts["/odometry_4"]["twist"]
    assert (twist["linear"]["x"], twist["angular"]["z"]) == (0.3, 0.2)
    assert texts["/bumper_5"] == {"data": True}
    assert not sensors.keys() & set(told["silent"])
