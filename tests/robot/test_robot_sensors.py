"""Sensors of a robot: their poses and bodies, and mounts that are refused."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree
from robot_cases import SENSORS, WHEEL, Whisker, append, find, independent, load, rover, some_mounts

from evoros.base.errors import InputError
from evoros.robot.mounting import MountDefaults
from evoros.sensor.protocol import Mount

angles = st.floats(-180.0, 180.0)


mounts = st.lists(
    st.builds(
        Mount,
        sensor=st.sampled_from(["whisker", "sonar"]),
        link=st.just("base_link"),
        x_m=st.floats(-1, 1),
        y_m=st.floats(-1, 1),
        z_m=st.floats(0, 1),
        yaw_deg=angles,
        pitch_deg=st.floats(-90, 90),
    ),
    max_size=8,
)


@pytest.mark.slow
@settings(max_examples=50, deadline=None)
@given(mounts)
def test_sensors_are_where_they_were_asked_to_be(placed: list[Mount]) -> None:
    robot = rover().with_sensors(placed, SENSORS)
    model = independent(robot.urdf)
    poses, frames = robot.sensor_poses, robot.sensor_frames
    assert poses.shape == (len(placed), 5)
    for i, mount in enumerate(robot.mounts):
        frame = model.get_transform(f"{mount.sensor}_{i}", "base_link")
        np.testing.assert_allclose(frames[i], frame, atol=1e-12)
        assert frame[:3, 3] == pytest.approx([mount.x_m, mount.y_m, mount.z_m], abs=1e-12)
        yaw, pitch = math.radians(mount.yaw_deg), math.radians(mount.pitch_deg)
        beam = (math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch))
        assert frame[:3, 0] == pytest.approx(beam, abs=1e-12)
        assert poses[i, 3:] == pytest.approx([yaw, pitch], abs=1e-12)


@settings(max_examples=50, deadline=None)
@given(mounts)
def test_sensors_of_a_type_are_together_in_their_order(placed: list[Mount]) -> None:
    robot = rover().with_sensors(placed, SENSORS)
    assert list(robot.mounts) == [m for name in SENSORS for m in placed if m.sensor == name]
    root = etree.fromstring(robot.urdf.encode())
    blocks = root.xpath("gazebo[sensor]")
    names = [f"{mount.sensor}_{i}" for i, mount in enumerate(robot.mounts)]
    assert [block.get("reference") for block in blocks] == names
    assert [block[0].get("name") for block in blocks] == names


def test_equipping_again_replaces_the_sensors() -> None:
    once = rover().with_sensors(some_mounts(2), SENSORS)
    assert (
        rover().with_sensors(some_mounts(), SENSORS).with_sensors(some_mounts(2), SENSORS).urdf
        == once.urdf
    )
    assert once.with_sensors([], SENSORS).urdf == rover().urdf


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"sensor": "radar"}, "sonar, whisker"),
        ({"link": "roof"}, "base_link"),
        ({"link": "rear_left_wheel"}, "fixed to the root"),
        ({"x_m": math.nan}, "x_m"),
        ({"yaw_deg": math.inf}, "yaw_deg"),
        ({"pitch_deg": None}, "pitch_deg"),
    ],
)
def test_a_mount_that_cannot_be_is_refused(change: dict[str, Any], says: str) -> None:
    mount = dataclasses.replace(some_mounts(1)[0], **change)
    with pytest.raises(InputError, match=says):
        rover().with_sensors([mount], SENSORS)


def test_names_must_be_plain_and_free_ones_are_chosen() -> None:
    mount = dataclasses.replace(some_mounts(1)[0], sensor='"/><evil')
    with pytest.raises(InputError, match="letters"):
        rover().with_sensors([mount], {mount.sensor: Whisker()})
    taken = dataclasses.replace(rover(), reserved_names=frozenset({"sonar_0"}))
    equipped, usual = (robot.with_sensors(some_mounts(2), SENSORS) for robot in (taken, rover()))
    names = [name for name, _ in equipped.named_mounts()]
    assert names == [f"evoros_{name}" for name, _ in usual.named_mounts()]
    assert names[0] in independent(equipped.urdf).link_map
    assert equipped.layout == usual.layout


def test_the_default_place_must_be_on_the_robot() -> None:
    with pytest.raises(InputError, match="front_left_wheel"):
        load(mount={"link": "front_left_wheel", "z_m": 0.1, "pitch_deg": 0.0})
    with pytest.raises(InputError, match="pitch_deg"):
        MountDefaults("base_link", 0.1, math.nan)


def test_a_sensor_has_the_body_of_its_type() -> None:
    heavy = dataclasses.replace(SENSORS["whisker"], mass_kg=2, size_m=[1, 2, 3])
    mounts = [dataclasses.replace(m, sensor=kind) for kind in SENSORS for m in some_mounts(1)]
    model = independent(rover().with_sensors(mounts, {**SENSORS, "whisker": heavy}).urdf)
    for link, mass, (x, y, z) in (
        ("sonar_0", 0.012, (0.01, 0.02, 0.03)),
        ("whisker_1", 2.0, (1, 2, 3)),
    ):
        body = model.link_map[link]
        assert body.inertial.mass == mass
        moments = np.array([y * y + z * z, x * x + z * z, x * x + y * y]) * mass / 12
        np.testing.assert_allclose(body.inertial.inertia, np.diag(moments), rtol=1e-12)
        assert list(body.visuals[0].geometry.box.size) == [x, y, z]
        assert not body.collisions


def test_sensors_on_a_turned_link_keep_their_place(tmp_path: Path) -> None:
    root = etree.fromstring(rover().base_urdf.text.encode())
    inertial = etree.tostring(find(root, f"{WHEEL}/inertial"), encoding="unicode")
    append(f'<link name="mast">{inertial}</link>')(root)
    append(
        '<joint name="mast_joint" type="fixed"><parent link="base_link"/><child link="mast"/>'
        '<origin xyz="0.1 -0.2 0.3" rpy="0 0 2"/></joint>'
    )(root)
    (tmp_path / "r.urdf").write_bytes(etree.tostring(root))
    bare = load(description=str(tmp_path / "r.urdf"), arguments={})
    mount = Mount("sonar", "mast", 0.05, 0.02, 0.01, 30.0, -20.0)
    robot = bare.with_sensors([mount], SENSORS)
    frame = independent(robot.urdf).get_transform("sonar_0", "base_link")
    np.testing.assert_allclose(robot.sensor_frames[0], frame, atol=1e-12)
