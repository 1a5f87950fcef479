"""Sensors: the geometry of their rays, what Gazebo is told, their configuration and their names."""

import math
from typing import Any

import numpy as np
import pytest
from bundled_parts import configured, every, kinds
from helpers import ROOT
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from evoros.filter.gaussian_noise import GaussianNoise
from evoros.filter.protocol import Filter
from evoros.filter.silence import Silence
from evoros.sensor.protocol import choose_prefix, find_prefix
from evoros.sensor.sonar import Sonar
from evoros.testing import ContactSensorSuite, RangeSensorSuite, SignalSensorSuite

BAD: dict[str, list[dict[str, Any]]] = {
    "sonar": [
        {"range_min_m": -0.1}, {"range_min_m": 4.5}, {"range_max_m": math.inf},
        {"range_max_m": 0.06}, {"fov_deg": 0.0}, {"fov_deg": 180.0}, {"rays_per_axis": 0},
        {"rays_per_axis": 2.5}, {"period_s": 0.0}, {"period_s": math.nan},
        {"size_m": [0.02, 0.02]}, {"size_m": [0.02, 0.02, 0.0]}, {"size_m": 0.02},
        {"mass_kg": 0.0}, {"filters": [GaussianNoise()]}, {"filters": {"noise": 0.005}},
    ],
    "multizone": [
        {"zones": 0}, {"zones": 2.5}, {"fov_deg": 0.0}, {"fov_deg": 180.0}, {"rays_per_zone": 0},
        {"base_price": -1.0}, {"zone_price": -0.1}, {"range_min_m": 4.0},
    ],
}  # fmt: skip
unhurried = settings(deadline=None)  # a busy machine is no failure
beams = st.builds(Sonar, fov_deg=st.floats(0.1, 179), rays_per_axis=st.integers(1, 9))


def test_every_sensor_module_has_a_configuration_of_its_name() -> None:
    package = ROOT / "evoros" / "sensor"
    shared = {"__init__", "protocol", "gazebo_rays", "signals", "names"}  # not types
    assert {path.stem for path in package.glob("*.py")} - shared == set(kinds("sensor"))


class TestRangeSensors(RangeSensorSuite):
    choose = every("sensor", ["infrared", "lidar", "multizone", "sonar"], BAD)


class TestImu(SignalSensorSuite):
    choose = every("sensor", ["imu"])


class TestOdometry(SignalSensorSuite):
    choose = every("sensor", ["odometry"])
    simulated_by_gazebo = False  # Gazebo's drive tells it


class TestBumper(ContactSensorSuite):
    choose = every("sensor", ["bumper"])


def test_configured_sonar_is_the_one_of_the_case_study() -> None:
    sonar = configured("sensor", "sonar")
    assert isinstance(sonar, Sonar)
    assert (sonar.range_min_m, sonar.range_max_m, sonar.period_s) == (0.06, 4.5, 0.1)
    assert sonar.filters == {"noise": GaussianNoise(sigma_m=0.005)}
    degrees = [-15.0, -7.5, 0.0, 7.5, 15.0]
    expected = {
        (math.cos(a) * math.cos(b), math.sin(a) * math.cos(b), math.sin(b))
        for a in map(math.radians, degrees)
        for b in map(math.radians, degrees)
    }
    rays = sonar.rays()
    assert len(rays) == len(expected) == 25
    for ray in rays:
        assert min(math.dist(ray, other) for other in expected) < 1e-15


def test_filters_are_added_and_changed_by_name() -> None:
    sensor = configured(
        "sensor", "sonar", "sensor.filters.noise.sigma_m=0.25", "+filter@sensor.filters.late=delay"
    )
    assert list(sensor.filters) == ["noise", "late"]
    assert sensor.filters["noise"] == GaussianNoise(0.25)


@unhurried
@given(beams)
def test_rays_are_mirror_images_of_each_other_bit_for_bit(sonar: Sonar) -> None:
    # Otherwise a robot and its mirror image would not drive mirrored ways.
    rays = {tuple(ray) for ray in (sonar.rays() + 0.0).tolist()}
    assert len(rays) == sonar.rays_per_axis**2
    assert rays == {(x, -y + 0.0, z) for x, y, z in rays}
    assert rays == {(x, y, -z + 0.0) for x, y, z in rays}


@unhurried
@given(beams)
def test_rays_fill_the_beam_to_its_edges(sonar: Sonar) -> None:
    x, y, z = sonar.rays().T
    edge = math.radians(sonar.fov_deg) / 2 if sonar.rays_per_axis > 1 else 0.0
    for angle in (np.arctan2(y, x), np.arcsin(z)):
        assert angle.max() == pytest.approx(edge, abs=1e-12)
        steps = np.unique(np.round(angle, 9))
        assert len(steps) == sonar.rays_per_axis
        assert np.ptp(np.diff(steps)) < 1e-8 if len(steps) > 2 else True


@unhurried
@given(beams, st.floats(0, 1), st.floats(0, 1), st.text("ab<>&\"' _", min_size=1))
def test_gazebo_is_told_the_same_sensor(sonar: Sonar, one: float, two: float, name: str) -> None:
    filters: dict[str, Filter] = {"a": GaussianNoise(one), "b": Silence(), "c": GaussianNoise(two)}
    sonar = Sonar(
        fov_deg=sonar.fov_deg, rays_per_axis=sonar.rays_per_axis, period_s=0.05, filters=filters
    )
    element = etree.fromstring(sonar.gazebo(name))
    assert element.get("name") == name
    assert element.findtext("topic") == name

    def number(path: str) -> float:
        return float(element.findtext(path) or "missing")

    rays = sonar.rays()
    azimuth = np.arctan2(rays[:, 1], rays[:, 0])
    for axis, angle in (("horizontal", azimuth), ("vertical", np.arcsin(rays[:, 2]))):
        assert number(f"lidar/scan/{axis}/samples") == sonar.rays_per_axis
        assert number(f"lidar/scan/{axis}/min_angle") == pytest.approx(angle.min(), abs=1e-12)
        assert number(f"lidar/scan/{axis}/max_angle") == pytest.approx(angle.max(), abs=1e-12)
    assert number("lidar/range/min") == sonar.range_min_m
    assert number("lidar/range/max") == sonar.range_max_m
    assert number("update_rate") == pytest.approx(20)
    assert number("lidar/noise/stddev") == pytest.approx(math.hypot(one, two))


TYPES = ("sonar", "imu", "sonar_wide")
taken = st.sets(
    st.builds(
        "{}{}_{}{}".format,
        st.sampled_from(["", "evoros_", "evoros_evoros_", "my_"]),
        st.sampled_from(["sonar", "imu", "sonar_wide", "lidar"]),
        st.integers(0, 12),
        st.sampled_from(["", "_joint"]),
    )
)


@given(taken, st.lists(st.sampled_from(TYPES), min_size=1, max_size=5))
def test_names_are_free_and_found_again(robot: set[str], mounted: list[str]) -> None:
    prefix = choose_prefix(robot, TYPES)
    links = {f"{prefix}{kind}_{index}" for index, kind in enumerate(mounted)}
    joints = {f"{link}_joint" for link in links}
    assert not (links | joints) & robot
    assert find_prefix(robot | links, TYPES) == prefix
    others = {name for name in robot if name.startswith(prefix)} - links
    assert not any(f"{prefix}{kind}_{index}" in others for kind in TYPES for index in range(13))


def test_a_robot_without_such_names_keeps_short_ones() -> None:
    names = ("base_link", "sonar", "sonar_link", "sonar_0_mount", "my_sonar_0")
    assert choose_prefix(names, TYPES) == ""
    assert choose_prefix((), ()) == ""
