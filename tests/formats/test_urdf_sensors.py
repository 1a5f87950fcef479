"""Sensors as descriptions of robots have them for Gazebo."""

import math

import pytest
from lxml import etree

from evoros.formats.urdf.sensors import BUMPER, IMU, LIDAR, SONAR, DescribedSensor, read_sensors

SCAN = """<scan><horizontal><samples>{samples}</samples><min_angle>{low}</min_angle>
<max_angle>{high}</max_angle></horizontal></scan>
<range><min>0.12</min><max>8</max></range>"""


def read(*sensors: str, link: str = "laser") -> tuple[list[DescribedSensor], list[str]]:
    blocks = "".join(f'<gazebo reference="{link}">{sensor}</gazebo>' for sensor in sensors)
    found = read_sensors(etree.fromstring(f'<robot name="bot">{blocks}</robot>'))
    return list(found.sensors), list(found.left_out)


@pytest.mark.parametrize(("given", "inner"), [("ray", "ray"), ("gpu_lidar", "lidar")])
def test_a_lidar_in_the_words_of_both_gazebos(given: str, inner: str) -> None:
    scan = SCAN.format(samples=181, low=-1.0, high=1.0)
    noise = "<noise><type>gaussian</type><stddev>0.01</stddev></noise>"
    (lidar,), left_out = read(
        f'<sensor type="{given}" name="scan"><pose>0 0 0.1 0 0 0</pose>'
        f"<update_rate>40</update_rate><{inner}>{scan}{noise}</{inner}></sensor>"
    )
    assert not left_out
    assert (lidar.kind, lidar.link, lidar.pose.position) == (LIDAR, "laser", (0, 0, 0.1))
    assert lidar.settings == {
        "period_s": 1 / 40,
        "range_min_m": 0.12,
        "range_max_m": 8.0,
        "sigma_m": 0.01,
        "fov_deg": pytest.approx(math.degrees(2.0)),
        "beams": 181,
    }


def test_a_fan_to_one_side_turns_the_sensor_by_its_middle() -> None:
    scan = SCAN.format(samples=10, low=-0.5, high=1.5)
    (lidar,), _ = read(f'<sensor type="ray" name="scan"><ray>{scan}</ray></sensor>')
    assert lidar.pose.yaw == pytest.approx(0.5)
    assert lidar.settings["fov_deg"] == pytest.approx(math.degrees(2.0))


def test_rays_that_are_published_as_one_distance_are_a_sonar() -> None:
    scan = SCAN.format(samples=5, low=-0.2, high=0.2)
    plugin = '<plugin name="p" filename="libgazebo_ros_range.so"/>'
    (sonar,), _ = read(f'<sensor type="ray" name="us"><ray>{scan}</ray>{plugin}</sensor>')
    assert sonar.kind == SONAR
    assert "beams" not in sonar.settings


def test_the_cone_of_a_sonar_has_its_radius_at_the_maximum_range() -> None:
    cone = "<sonar><min>0.05</min><max>3</max><radius>3</radius></sonar>"
    (sonar,), _ = read(f'<sensor type="sonar" name="us">{cone}</sensor>')
    assert sonar.settings["fov_deg"] == pytest.approx(90.0)


def test_sensors_without_distances() -> None:
    sensors, left_out = read(
        '<sensor type="imu" name="i"><update_rate>0</update_rate></sensor>',
        '<sensor type="contact" name="c"/>',
    )
    assert [(sensor.kind, dict(sensor.settings)) for sensor in sensors] == [(IMU, {}), (BUMPER, {})]
    assert not left_out


@pytest.mark.parametrize(
    ("sensor", "told"),
    [
        ('<sensor type="camera" name="eye"/>', "must be of a type that evoros has, not 'camera'"),
        ('<sensor type="ray" name="eye"/>', "must have a <ray> or <lidar>"),
        (
            f'<sensor type="ray" name="eye"><ray>{SCAN.format(samples=3, low=1, high=0)}</ray>'
            "</sensor>",
            "must have a max_angle of at least its min_angle (1), not 0",
        ),
        (
            '<sensor type="sonar" name="eye"><sonar><min>3</min><max>1</max><radius>1</radius>'
            "</sonar></sensor>",
            "must have a min below its max (1 m), not 3 m",
        ),
    ],
)
def test_what_makes_no_sense_is_left_out_and_told(sensor: str, told: str) -> None:
    sensors, (line,) = read(sensor)
    assert not sensors
    assert line.startswith("left out: ")
    assert "'eye'" in line
    assert told in line
    assert "\n" not in line
