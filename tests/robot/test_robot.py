"""Robots are compared with independent readers of URDF, and one with published measures."""

import logging
import math
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yourdfpy
from fixture_types import Log, Patch
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree
from planar_cases import start, state_of, world_of
from robot_cases import ROBOTS, SENSORS, car, configuration, independent, load, rover, some_mounts

from evoros import compose
from evoros.base.arrays import YAW_RATE, Array
from evoros.formats.urdf.tree import UrdfDocument, read_tree
from evoros.geometry.shapes import Pose
from evoros.preflight.trial_drive import find_turning_point
from evoros.robot import second_reading
from evoros.robot.model import Robot
from evoros.robot.second_reading import read_again, report_second_reading
from evoros.sensor.sonar import Sonar
from evoros.simulator.planar import Planar


def test_the_default_rover_has_the_measures_of_the_paper() -> None:
    robot, drive = rover(), car()
    assert drive.wheelbase_m == pytest.approx(0.334)
    assert (drive.steered_radius_m, drive.fixed_radius_m) == pytest.approx((0.0635, 0.0635))
    assert drive.steering_limit_rad == 0.7727
    assert np.ptp(robot.outline, axis=0) == pytest.approx([0.465, 0.325])
    assert (robot.mount_link, robot.mount_z_m, robot.mount_pitch_deg) == ("base_link", 0.166, 12.5)
    assert 0.145 <= robot.height_m <= 0.2


def test_the_rover_as_run_has_the_contact_box_of_the_workspace() -> None:
    robot, drive = rover("erle_rover_as_run"), car("erle_rover_as_run")
    assert drive.wheelbase_m == pytest.approx(0.390)
    assert drive.fixed_track_m == pytest.approx(0.300)
    assert drive.steered_track_m == pytest.approx(0.286)
    assert robot.outline.min(axis=0) == pytest.approx([-0.275, -0.1])
    assert robot.outline.max(axis=0) == pytest.approx([0.375, 0.1])
    assert robot.height_m == pytest.approx(0.077)
    assert robot.mount_pitch_deg == 14.0


@pytest.mark.parametrize("place", [0.12, -0.3])
def test_a_stated_turning_point_moves_the_circle_and_changes_neither_it_nor_the_wheels(
    place: float,
) -> None:
    described = configuration("erle_rover_as_run")["drive"]
    sliding, rolling = (
        load("erle_rover_as_run", drive={**described, "turning_x_m": x}) for x in (place, None)
    )
    assert sliding.drive.targets(0.3, 0.4) == rolling.drive.targets(0.3, 0.4)
    assert sliding.engine_text == rolling.engine_text
    for robot, x in ((sliding, place), (rolling, -0.15)):
        speed, lock = 0.3, robot.drive.steering_limit
        simulator = Planar(steering_lag_s=0.0)
        turning_x = find_turning_point(simulator, robot, world_of(), speed)
        assert turning_x == pytest.approx(x, abs=1e-9)
        simulation = start(world_of(), robot)
        simulation.advance(np.array([speed, lock]), 0.1)
        rate = speed * math.tan(lock) / rolling.drive.wheelbase_m
        assert state_of(simulation)[YAW_RATE] == pytest.approx(rate, abs=1e-12)


def test_the_outline_covers_the_wheels_and_turns_left() -> None:
    outline = rover().outline
    model = independent(rover().urdf)
    for wheel in car().wheel_joints:
        center = model.get_transform(model.joint_map[wheel].child, "base_link")[:3, 3]
        for corner in ((0.0635, 0.028), (-0.0635, 0.028), (0.0635, -0.028), (-0.0635, -0.028)):
            x, y = center[:2] + corner
            ahead = np.roll(outline, -1, axis=0) - outline
            side = ahead[:, 0] * (y - outline[:, 1]) - ahead[:, 1] * (x - outline[:, 0])
            assert (side >= -1e-12).all()


@pytest.mark.parametrize("name", ROBOTS)
def test_the_masses_are_those_of_a_small_rover(name: str) -> None:
    links = independent(rover(name).urdf).link_map.values()
    assert 3.0 <= sum(link.inertial.mass for link in links) <= 4.0


@pytest.mark.parametrize("name", ROBOTS)
def test_our_kinematics_are_those_of_yourdfpy(name: str) -> None:
    model = independent(rover(name).urdf)
    tree = read_tree(etree.fromstring(rover(name).urdf.encode()), name)
    assert set(tree.poses) == set(model.link_map)
    for link, pose in tree.poses.items():
        np.testing.assert_allclose(matrix(pose), model.get_transform(link, tree.root), atol=1e-12)


@pytest.fixture
def new_cache(tmp_path: Path, monkeypatch: Patch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "evoros" / "second_readings"


def with_moved_wheel() -> Robot:
    """A robot whose wheel is 2 mm from where the simulator puts it."""
    robot = rover()
    moved = robot.base_urdf.copy_elements()
    origin = moved.find("joint[@name='rear_left_wheel_joint']/origin")
    assert origin is not None
    x, y, z = map(float, origin.get("xyz", "").split())
    origin.set("xyz", f"{x} {y + 0.002} {z}")
    return replace(robot, base_urdf=UrdfDocument.from_elements(moved), engine_urdf=robot.base_urdf)


@pytest.mark.usefixtures("new_cache")
def test_a_second_reading_agrees_until_a_link_is_moved() -> None:
    agrees, result = read_again(rover())
    assert agrees
    assert "agrees on the positions of all" in result
    moved = (False, "yourdfpy disagrees on the position of rear_left_wheel by 2 mm")
    assert [read_again(with_moved_wheel()) for _ in range(2)] == [moved, moved]


def test_yourdfpy_reads_a_description_once(new_cache: Path, monkeypatch: Patch) -> None:
    first = read_again(rover())
    with monkeypatch.context() as patch:
        patch.setattr(yourdfpy.URDF, "load", None)  # a call would raise
        assert read_again(rover()) == first
        agrees, result = read_again(with_moved_wheel())
        assert agrees
        assert result.startswith("yourdfpy cannot read the file (TypeError")
        patch.setattr(second_reading, "version", lambda _: "another")
        assert read_again(rover())[1].startswith("yourdfpy cannot read")
    (kept,) = new_cache.iterdir()
    kept.write_text("{")
    assert read_again(rover()) == first


@pytest.mark.usefixtures("new_cache")
def test_a_difference_is_a_warning_and_agreement_is_only_in_the_log(caplog: Log) -> None:
    caplog.set_level(logging.DEBUG)
    report_second_reading([rover(), rover(), with_moved_wheel()])
    lines = [
        (record.levelname, record.getMessage().split(": ")[1][:18]) for record in caplog.records
    ]
    assert lines == [("DEBUG", "yourdfpy agrees on"), ("WARNING", "yourdfpy disagrees")]


def matrix(pose: Pose) -> Array:
    placed = np.eye(4)
    placed[:3, :3] = pose.rotation
    placed[:3, 3] = pose.position
    return placed


def test_a_robot_travels_to_workers() -> None:
    robot = rover().with_sensors(some_mounts(), SENSORS)
    copy = pickle.loads(pickle.dumps(robot))
    assert copy.urdf == robot.urdf
    assert copy.drive == robot.drive
    np.testing.assert_array_equal(copy.sensor_poses, robot.sensor_poses)


def test_the_elements_are_those_of_the_text_here_and_in_a_worker() -> None:
    """But for Gazebo's; whoever gets them may change them."""
    robot = rover().with_sensors(some_mounts(), SENSORS)
    expected = canonical(etree.fromstring(robot.urdf.encode()))
    for here in (robot, pickle.loads(pickle.dumps(robot))):
        for _ in range(2):
            elements = here.urdf_elements()
            assert canonical(elements) == expected
            elements.clear()


def canonical(root: etree._Element) -> str:
    etree.strip_elements(root, "gazebo")
    return etree.canonicalize(etree.tostring(root).decode(), strip_text=True)


READERS = {
    "pybullet": """
import pybullet, sys
pybullet.connect(pybullet.DIRECT)
body = pybullet.loadURDF(sys.argv[1])
joints = [pybullet.getJointInfo(body, i) for i in range(pybullet.getNumJoints(body))]
print(*(joint[1].decode() for joint in joints))
mass = sum(pybullet.getDynamicsInfo(body, i)[0] for i in range(-1, len(joints)))
assert 3 < mass < 4, mass
assert all(joint[10] > 0 for joint in joints if joint[2] != pybullet.JOINT_FIXED)
""",
    "yourdfpy": """
import sys, yourdfpy
print(*yourdfpy.URDF.load(sys.argv[1]).joint_map)
""",
}


@pytest.mark.slow
@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("name", ROBOTS)
def test_other_readers_load_it_without_a_word(tmp_path: Path, reader: str, name: str) -> None:
    robot = rover(name).with_sensors(some_mounts(), SENSORS)
    (tmp_path / "r.urdf").write_text(robot.urdf)
    command = [
        sys.executable,
        "-W",
        "error::UserWarning",
        "-c",
        READERS[reader],
        str(tmp_path / "r.urdf"),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    noise = [line for line in done.stderr.splitlines() if "build time" not in line]
    assert done.returncode == 0, done.stderr
    assert noise == []
    drive, tree = robot.drive, read_tree(etree.fromstring(rover(name).urdf.encode()), name)
    joints = {*tree.joints, *(f"sonar_{i}_joint" for i in range(6))}
    assert {*drive.steering_joints, *drive.wheel_joints} <= joints
    (line,) = (line for line in done.stdout.splitlines() if "build time" not in line)
    assert set(line.split()) == joints


@pytest.mark.parametrize("shape", ["sphere", "cylinder"])
def test_the_collision_shape_of_the_wheels_can_be_chosen(shape: str) -> None:
    robot = load(arguments={"wheel_collision": shape})
    assert len(etree.fromstring(robot.urdf.encode()).findall(f".//collision//{shape}")) == 4
    assert robot.drive == rover().drive


@pytest.mark.slow
@given(st.floats(0.05, 0.3), st.floats(-0.3, -0.05))
@settings(max_examples=5, deadline=None)
def test_the_wheelbase_follows_the_description(front: float, rear: float) -> None:
    drive = load(arguments={"front_axle_x": front, "rear_axle_x": rear}).drive
    assert drive.wheelbase_m == pytest.approx(front - rear, abs=1e-12)
    assert drive.rear_axle_x_m == pytest.approx(rear, abs=1e-12)


def test_a_sound_copy_of_the_urdf_is_the_same_robot(tmp_path: Path) -> None:
    (tmp_path / "copy.urdf").write_text(rover().base_urdf.text)
    copy = load(description=str(tmp_path / "copy.urdf"), arguments={})
    assert copy.urdf == rover().urdf
    assert copy.drive == rover().drive


def test_the_file_is_read_without_the_slow_libraries() -> None:
    code = (
        "import sys, evoros.robot.loading\n"
        "assert not {'yourdfpy', 'trimesh', 'pybullet', 'xacro', 'scipy'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_mount_that_is_left_out_is_chosen_for_the_robot(name: str) -> None:
    robot = load(name, mount={})
    low, high = (
        end([solid.height_range[k] for solid in robot.solids if solid.link == robot.mount_link])
        for k, end in ((0, min), (1, max))
    )
    height = robot.sensor_links[robot.mount_link][2] + robot.mount_z_m
    assert low < height < high
    assert height == pytest.approx((max(low, 0) + high) / 2)
    assert robot.mount_link == "base_link"
    assert robot.mount_pitch_deg is None
    edge = math.radians(15)  # the lowest rays are those at the corners of the beam
    level = math.degrees(math.atan(math.tan(edge) / math.cos(edge)))
    assert robot.default_pitch([Sonar(fov_deg=30), Sonar(fov_deg=20)]) == pytest.approx(level)
    assert robot.chosen_mount == ("link", "z_m", "pitch_deg")
    stated = load(name)
    assert stated.chosen_mount == ()
    assert stated.default_pitch([Sonar(fov_deg=80)]) == stated.mount_pitch_deg


def test_it_has_the_published_size_mass_and_wheels() -> None:
    robot = compose(["robot=coyote", "world=barn", "design=around"]).build().members[0].robot
    length, width = np.ptp(robot.outline, axis=0)
    assert (length, width) == (pytest.approx(0.508), pytest.approx(0.430))
    assert robot.drive.max_speed_mps == 2.0
    described = etree.fromstring(robot.urdf.encode())
    masses = [float(mass.get("value", "0")) for mass in described.iter("mass")]
    assert sum(masses) == pytest.approx(17.0)
    assert {wheel.get("radius") for wheel in described.iter("cylinder")} == {"0.098"}
