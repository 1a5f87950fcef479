"""Robots are held against independent readers of URDF: yourdfpy and PyBullet."""

import dataclasses
import io
import math
import pickle
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from hydra import compose, initialize_config_dir
from hydra.utils import instantiate
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree
from omegaconf import OmegaConf

from evoros.base import resources as assets
from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.drive.ackermann import Ackermann
from evoros.filter.protocol import Filter
from evoros.formats.urdf.tree import read_tree
from evoros.geometry.shapes import Pose
from evoros.robot.loading import MountDefaults, load_robot
from evoros.robot.model import Robot
from evoros.sensor.protocol import Mount

ROBOTS = ["erle_rover", "erle_rover_as_run", "two_wheeler"]


@dataclass(frozen=True)
class Whisker:
    """The least sensor: one ray."""

    period_s: float = 0.1
    range_min_m: float = 0.0
    range_max_m: float = 1.0
    size_m: Sequence[float] = (0.01, 0.02, 0.03)
    mass_kg: float = 0.012
    filters: Mapping[str, Filter] = field(default_factory=dict)

    def rays(self) -> Array:
        return np.array([[1.0, 0.0, 0.0]])

    def gazebo(self, name: str) -> str:
        return f'<sensor name="{name}" type="ray"/>'


SENSORS: Any = {"sonar": Whisker(), "whisker": Whisker()}


def configuration(name: str) -> dict[str, Any]:
    with initialize_config_dir(str(assets.bundled_folder("conf")), version_base=None):
        composed = compose(overrides=[f"+robot={name}"])
    config: dict[str, Any] = cast(Any, OmegaConf.to_container(composed))["robot"]
    return config


def load(name: str = "erle_rover", **changes: Any) -> Robot:
    config = {**configuration(name), **changes}
    mount = {key: value for key, value in config["mount"].items() if key != "_target_"}
    return load_robot(
        description=config["description"],
        arguments=config["arguments"],
        packages=config["packages"],
        mount=MountDefaults(**mount),
        drive=instantiate(config["drive"], _convert_="all"),
    )


@cache
def rover(name: str = "erle_rover") -> Robot:
    return load(name)


def car(name: str = "erle_rover") -> Ackermann:
    drive = rover(name).drive
    assert isinstance(drive, Ackermann)
    return drive


def independent(urdf: str) -> Any:
    import yourdfpy

    return yourdfpy.URDF.load(io.BytesIO(urdf.encode()), load_meshes=False)


def test_the_default_rover_has_the_measures_of_the_paper() -> None:
    robot, drive = rover(), car()
    assert drive.wheelbase_m == pytest.approx(0.334)
    assert drive.wheel_radius_m == pytest.approx(0.0635)
    assert drive.steering_limit_rad == 0.7727
    assert np.ptp(robot.outline, axis=0) == pytest.approx([0.465, 0.325])
    assert (robot.mount_link, robot.mount_z_m, robot.mount_pitch_deg) == ("base_link", 0.166, 12.5)
    assert 0.145 <= robot.height_m <= 0.2


def test_the_rover_as_run_has_the_contact_box_of_the_workspace() -> None:
    robot, drive = rover("erle_rover_as_run"), car("erle_rover_as_run")
    assert drive.wheelbase_m == pytest.approx(0.390)
    assert drive.rear_track_m == pytest.approx(0.300)
    assert drive.front_track_m == pytest.approx(0.286)
    assert robot.outline.min(axis=0) == pytest.approx([-0.275, -0.1])
    assert robot.outline.max(axis=0) == pytest.approx([0.375, 0.1])
    assert robot.height_m == pytest.approx(0.077)
    assert robot.mount_pitch_deg == 14.0


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


def matrix(pose: Pose) -> Array:
    placed = np.eye(4)
    placed[:3, :3] = pose.rotation
    placed[:3, 3] = pose.position
    return placed


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


@settings(max_examples=50, deadline=None)
@given(mounts)
def test_sensors_are_where_they_were_asked_to_be(placed: list[Mount]) -> None:
    robot = rover().with_sensors(placed, SENSORS)
    model = independent(robot.urdf)
    poses, frames = robot.sensor_poses(), robot.sensor_frames()
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


def some_mounts(count: int = 6) -> list[Mount]:
    return [Mount("sonar", "base_link", 0.2, 0.01 * i, 0.166, 10.0 * i, 12.5) for i in range(count)]


def test_equipping_again_replaces_the_sensors() -> None:
    once = rover().with_sensors(some_mounts(2), SENSORS)
    assert (
        rover().with_sensors(some_mounts(), SENSORS).with_sensors(some_mounts(2), SENSORS).urdf
        == once.urdf
    )
    assert once.with_sensors([], SENSORS).urdf == rover().urdf


def test_equipping_is_fast_enough_for_every_individual() -> None:
    robot = rover()
    best = math.inf
    for _ in range(20):
        start = time.perf_counter()
        assert robot.with_sensors(some_mounts(), SENSORS).urdf
        best = min(best, time.perf_counter() - start)
    assert best < 2e-3


def test_a_robot_travels_to_workers() -> None:
    robot = rover().with_sensors(some_mounts(), SENSORS)
    copy = pickle.loads(pickle.dumps(robot))
    assert copy.urdf == robot.urdf
    assert copy.drive == robot.drive
    np.testing.assert_array_equal(copy.sensor_poses(), robot.sensor_poses())


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


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("name", ROBOTS)
def test_other_readers_load_it_without_a_word(tmp_path: Path, reader: str, name: str) -> None:
    if reader == "pybullet":
        pytest.importorskip("pybullet")
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


@given(st.floats(0.05, 0.3), st.floats(-0.3, -0.05))
@settings(max_examples=5, deadline=None)
def test_the_wheelbase_follows_the_description(front: float, rear: float) -> None:
    drive = load(arguments={"front_axle_x": front, "rear_axle_x": rear}).drive
    assert drive.wheelbase_m == pytest.approx(front - rear, abs=1e-12)
    assert drive.rear_axle_x_m == pytest.approx(rear, abs=1e-12)


Edit = Callable[[etree._Element], object]


def find(root: etree._Element, path: str) -> etree._Element:
    found = root.find(path)
    assert found is not None, path
    return found


def drop(path: str) -> Edit:
    def edit(root: etree._Element) -> None:
        element = find(root, path)
        parent = element.getparent()
        assert parent is not None
        parent.remove(element)

    return edit


def put(path: str, **attributes: str) -> Edit:
    return lambda root: find(root, path).attrib.update(attributes)


def append(xml: str, path: str = ".") -> Edit:
    return lambda root: find(root, path).append(etree.fromstring(xml))


WHEEL = "link[@name='rear_left_wheel']"
WHEEL_JOINT = "joint[@name='rear_left_wheel_joint']"
STEERING = "joint[@name='front_left_steering_joint']"
FAULTS: dict[str, tuple[Edit, str]] = {
    "no inertia": (drop(f"{WHEEL}/inertial"), "inertial"),
    "no mass": (drop(f"{WHEEL}/inertial/mass"), "mass"),
    "mass 0": (put(f"{WHEEL}/inertial/mass", value="0"), "greater than 0"),
    "mass not finite": (put(f"{WHEEL}/inertial/mass", value="nan"), "finite"),
    "mass in words": (put(f"{WHEEL}/inertial/mass", value="much"), "'much'"),
    "moment 0": (put(f"{WHEEL}/inertial/inertia", ixx="0"), "principal"),
    "impossible moments": (put(f"{WHEEL}/inertial/inertia", izz="1"), "principal"),
    "two numbers": (put(f"{WHEEL_JOINT}/origin", xyz="0 1"), "3 finite numbers"),
    "no such child": (put(f"{WHEEL_JOINT}/child", link="nothing"), "'nothing'"),
    "no such parent": (put(f"{WHEEL_JOINT}/parent", link="nothing"), "'nothing'"),
    "no parent": (drop(f"{WHEEL_JOINT}/parent"), "parent"),
    "unknown type": (put(WHEEL_JOINT, type="rubber"), "rubber"),
    "fixed wheel": (put(WHEEL_JOINT, type="fixed"), "continuous, not fixed"),
    "missing wheel joint": (put(WHEEL_JOINT, name="other"), "rear_left_wheel_joint"),
    "missing steering joint": (put(STEERING, name="other"), "front_left_steering_joint"),
    "no name": (put(WHEEL_JOINT, name=""), "name"),
    "same link twice": (append('<link name="base_link"/>'), "base_link"),
    "same joint twice": (put(STEERING, name="rear_left_wheel_joint"), "rear_left_wheel_joint"),
    "two roots": (drop(WHEEL_JOINT), "rear_left_wheel"),
    "circle": (put(f"{WHEEL_JOINT}/parent", link="rear_left_wheel"), "circle"),
    "two parents": (put(f"{STEERING}/child", link="rear_left_wheel"), "one joint above"),
    "no geometry": (drop(f"{WHEEL}/collision/geometry/sphere"), "not nothing"),
    "no collision": (drop(f"{WHEEL}/collision"), "rear_left_wheel"),
    "wheel of a mesh": (append("<mesh/>", f"{WHEEL}/collision/geometry"), "mesh"),
    "radius 0": (put(f"{WHEEL}/collision/geometry/sphere", radius="0"), "above 0"),
    "other radius": (put(f"{WHEEL}/collision/geometry/sphere", radius="0.06"), "ground"),
    "in the air": (put(f"{WHEEL_JOINT}/origin", xyz="-0.15 0.1345 0.07"), "ground"),
    "not opposite": (put(f"{WHEEL_JOINT}/origin", xyz="-0.17 0.1345 0.0635"), "opposite"),
    "on the right": (put(f"{WHEEL_JOINT}/origin", xyz="-0.15 -0.2 0.0635"), "left of"),
    "axis 0": (put(f"{WHEEL_JOINT}/axis", xyz="0 0 0"), "length 0"),
    "axis backward": (put(f"{WHEEL_JOINT}/axis", xyz="0 -1 0"), "to the left"),
    "no torque": (put(f"{WHEEL_JOINT}/limit", effort="0"), "effort"),
    "narrow steering": (put(f"{STEERING}/limit", lower="-0.5"), "at most 0.5"),
    "steering limits swapped": (put(f"{STEERING}/limit", lower="1", upper="-1"), "lower"),
    "steering without limit": (drop(f"{STEERING}/limit"), "limit"),
    "nothing to touch with": (drop("link[@name='base_link']/collision"), ""),
    "another document": (lambda root: setattr(root, "tag", "sdf"), "<robot>"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_robot_is_one_clear_line(tmp_path: Path, fault: str) -> None:
    edit, says = FAULTS[fault]
    root = etree.fromstring(rover().base_urdf.text.encode())
    edit(root)
    if fault == "nothing to touch with":
        edit(root)  # contact box and cage
    path = tmp_path / "faulty.urdf"
    path.write_bytes(etree.tostring(root))
    with pytest.raises(InputError) as caught:
        load(description=str(path), arguments={})
    message = str(caught.value)
    assert says in message
    assert "\n" not in message
    assert ";" in message
    assert str(path) in message or "steering_limit_rad" in message


def test_a_sound_copy_of_the_urdf_is_the_same_robot(tmp_path: Path) -> None:
    (tmp_path / "copy.urdf").write_text(rover().base_urdf.text)
    copy = load(description=str(tmp_path / "copy.urdf"), arguments={})
    assert copy.urdf == rover().urdf
    assert copy.drive == rover().drive


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


def test_names_must_be_free_and_plain() -> None:
    mount = dataclasses.replace(some_mounts(1)[0], sensor='"/><evil')
    with pytest.raises(InputError, match="letters"):
        rover().with_sensors([mount], {mount.sensor: Whisker()})
    taken = dataclasses.replace(rover(), reserved_names=frozenset({"sonar_0"}))
    with pytest.raises(InputError, match="sonar_0"):
        taken.with_sensors(some_mounts(1), SENSORS)


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
    np.testing.assert_allclose(robot.sensor_frames()[0], frame, atol=1e-12)


def test_the_file_is_read_without_the_slow_libraries() -> None:
    code = (
        "import sys, evoros.robot.loading\n"
        "assert not {'yourdfpy', 'trimesh', 'pybullet', 'xacro', 'scipy'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
