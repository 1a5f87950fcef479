"""Sensors as descriptions of robots have them for Gazebo."""

import math

import pytest
from lxml import etree

from evoros.formats.urdf.sensors import BUMPER, IMU, LIDAR, SONAR, DescribedSensor, read_sensors
from evoros.sensor.multizone import Multizone

SCAN = """<scan><horizontal><samples>{samples}</samples><min_angle>{low}</min_angle>
<max_angle>{high}</max_angle></horizontal></scan>
<range><min>0.12</min><max>8</max></range>"""


def read(*sensors: str, link: str = "laser") -> tuple[list[DescribedSensor], list[str]]:
    blocks = "".join(f'<gazebo reference="{link}">{sensor}</gazebo>' for sensor in sensors)
    read = read_sensors(etree.fromstring(f'<robot name="bot">{blocks}</robot>'))
    return list(read.sensors), list(read.left_out)


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
        "noise.sigma_m": 0.01,
        "fov_deg": pytest.approx(math.degrees(2.0)),
        "beams": 181,
    }


def test_a_fan_to_one_side_turns_the_sensor_by_its_middle() -> None:
    scan = SCAN.format(samples=10, low=-0.5, high=1.5)
    (lidar,), _ = read(f'<sensor type="ray" name="scan"><ray>{scan}</ray></sensor>')
    assert lidar.pose.yaw == pytest.approx(0.5)
    assert lidar.settings["fov_deg"] == pytest.approx(math.degrees(2.0))


@pytest.mark.parametrize(("edge", "told"), [(3.1416, False), (6.2832, False), (135, True)])
def test_angles_of_a_scan_in_degrees_are_told(edge: float, told: bool) -> None:
    scan = SCAN.format(samples=271, low=-edge, high=edge)
    (lidar,), _ = read(f'<sensor type="ray" name="scan"><ray>{scan}</ray></sensor>')
    assert lidar.settings["fov_deg"] == pytest.approx(360.0)
    assert any("may be in degrees" in note for note in lidar.notes) == told


@pytest.mark.parametrize(("resolution", "ranges"), [(1, 181), (2, 362), (0.25, 45), (0.012, 2)])
def test_a_lidar_has_as_many_ranges_as_samples_times_resolution(
    resolution: float, ranges: int
) -> None:
    """``RangeCount`` of Gazebo Classic's ``RaySensor`` and of ``Lidar`` in gz-sensors."""
    scan = SCAN.format(samples=181, low=-1.0, high=1.0)
    scan = scan.replace("<min_angle>", f"<resolution>{resolution}</resolution><min_angle>")
    (lidar,), _ = read(f'<sensor type="ray" name="scan"><ray>{scan}</ray></sensor>')
    assert lidar.settings["beams"] == ranges
    assert any(f"181 rays for {ranges} ranges" in note for note in lidar.notes) == (ranges != 181)


def test_rays_that_are_published_as_one_distance_are_a_sonar() -> None:
    scan = SCAN.format(samples=5, low=-0.2, high=0.2)
    plugin = '<plugin name="p" filename="libgazebo_ros_range.so"/>'
    (sonar,), _ = read(f'<sensor type="ray" name="us"><ray>{scan}</ray>{plugin}</sensor>')
    assert sonar.kind == SONAR
    assert "beams" not in sonar.settings


@pytest.mark.parametrize("plugin", ["", '<plugin name="p" filename="libgazebo_ros_range.so"/>'])
@pytest.mark.parametrize(
    ("given", "samples", "low", "high", "yaw"),
    [
        ("ray", 1, 0.0, 0.0, 0.0),
        ("ray", 1, 0.2, 0.6, 0.0),  # the yaw of a single ray in Gazebo Classic's MultiRayShape
        ("ray", 7, 0.4, 0.4, 0.4),
        ("gpu_lidar", 1, 0.4, 0.4, 0.4),
    ],
)
def test_a_single_ray_is_a_range_finder_that_its_type_accepts(
    plugin: str, given: str, samples: int, low: float, high: float, yaw: float
) -> None:
    scan = SCAN.format(samples=samples, low=low, high=high)
    (finder,), _ = read(f'<sensor type="{given}" name="tof"><ray>{scan}</ray>{plugin}</sensor>')
    assert finder.pose.yaw == pytest.approx(yaw)
    sensor = Multizone(**finder.settings)  # type: ignore[arg-type]
    assert sensor.rays().tolist() == [[1.0, 0.0, 0.0]]
    assert len(sensor.channels) == 1


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
        ('<sensor type="camera" name="eye"/>', "must be of a supported type, not 'camera'"),
        ('<sensor type="ray" name="eye"/>', "must have a <ray> or <lidar>"),
        (
            f'<sensor type="ray" name="eye"><ray>{SCAN.format(samples=3, low=1, high=0)}</ray>'
            "</sensor>",
            "has a max_angle (0) below its min_angle (1)",
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


def noisy(kind: str, **values: float) -> str:
    inner = "".join(f"<{name}>{value}</{name}>" for name, value in values.items())
    return f'<noise type="{kind}">{inner}</noise>'


def imu(**axes: str) -> DescribedSensor:
    rates = "".join(f"<{axis}>{noise}</{axis}>" for axis, noise in axes.items())
    (sensor,), left_out = read(
        '<sensor type="imu" name="i"><imu><angular_velocity>'
        f"{rates}</angular_velocity></imu></sensor>"
    )
    assert not left_out
    return sensor


def test_the_noise_of_an_imu() -> None:
    """Values that the description does not state are 0; without a noise they stay."""
    noise = noisy("gaussian", mean=0.01, stddev=0.002, bias_stddev=0.0005)
    sensor = imu(x=noise, y=noise, z=noise)
    assert sensor.settings == {
        "rate_noise.sigma_m": 0.002,
        "rate_bias.offset_m": 0.01,
        "rate_bias.sd_m": 0.0005,
    }
    assert sensor.notes == ()
    older = (
        '<sensor type="imu" name="i"><imu><noise><type>gaussian</type><rate><stddev>0.1</stddev>'
        "</rate><accel><stddev>0.3</stddev></accel></noise></imu></sensor>"
    )
    ((sensor,), _) = read(older)
    assert sensor.settings["rate_noise.sigma_m"] == 0.1
    assert sensor.settings["acceleration_noise.sigma_m"] == 0.3
    assert imu(z=noisy("none", stddev=1.0)).settings["rate_noise.sigma_m"] == 0.0
    (note,) = imu(z=noise).notes  # the other axes have none
    assert "the difference in stddev between axes" in note


def test_what_an_imu_loses_of_its_noise_is_named_in_one_note() -> None:
    """A mean bias is part of the spread, because Gazebo draws its sign."""
    drifting = noisy("gaussian", stddev=0.1, bias_mean=3.0, bias_stddev=4.0, dynamic_bias_stddev=1)
    sensor = imu(x=noisy("gaussian", stddev=0.2), z=drifting)
    assert sensor.settings["rate_noise.sigma_m"] == 0.2
    assert sensor.settings["rate_bias.sd_m"] == 5.0
    (note,) = sensor.notes
    for named in ("<angular_velocity>", "dynamic_bias_stddev", "bias_mean", "in stddev between"):
        assert named in note


@pytest.mark.parametrize(
    ("noise", "named"),
    [
        ("<noise><stddev>0.02</stddev><mean>0.1</mean></noise>", "mean"),
        (noisy("gaussian", stddev=0.02, bias_stddev=0.1), "bias_stddev"),
        (noisy("gaussian_quantized", stddev=0.02, precision=0.01), "precision"),
        (noisy("custom", stddev=0.02), "type custom"),
    ],
)
def test_what_a_lidar_loses_of_its_noise_is_named(noise: str, named: str) -> None:
    scan = SCAN.format(samples=3, low=-1, high=1)
    (lidar,), _ = read(f'<sensor type="ray" name="s"><ray>{scan}{noise}</ray></sensor>')
    assert lidar.settings["noise.sigma_m"] == 0.02
    (note,) = lidar.notes
    assert note.endswith(f": {named}")


def test_a_noise_that_makes_no_sense_is_told() -> None:
    scan = SCAN.format(samples=3, low=-1, high=1)
    noise = noisy("gaussian", stddev=-1)
    sensors, (line,) = read(f'<sensor type="ray" name="s"><ray>{scan}{noise}</ray></sensor>')
    assert not sensors
    assert "at least 0, not -1" in line
