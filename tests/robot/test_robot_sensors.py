"""Sensors of a robot: their poses and bodies, refused mounts, and where they see the robot."""

import dataclasses
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree
from numpy.typing import NDArray
from robot_cases import SENSORS, WHEEL, Whisker, append, find, independent, load, rover, some_mounts

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.geometry.shapes import Pose, Shape
from evoros.robot.model import Robot
from evoros.robot.mounting import MountDefaults
from evoros.robot.outline import Occluder, Occluders
from evoros.robot.self_sight import find_self_sights, measure_clear_ranges
from evoros.sensor.lidar import Lidar
from evoros.sensor.protocol import Mount
from evoros.sensor.sonar import Sonar

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


SAMPLE_M = 1e-3
RAY = Sonar(rays_per_axis=1)
FAR_M = RAY.range_max_m

lengths = st.floats(0.04, 0.3)
places = st.floats(-0.4, 0.4)
radians = st.floats(-math.pi, math.pi)
shapes = st.one_of(
    st.builds(lambda x, y, z: Shape("box", (x, y, z)), lengths, lengths, lengths),
    st.builds(lambda r, h: Shape("cylinder", (r, h)), lengths, lengths),
    st.builds(lambda r: Shape("sphere", (r,)), lengths),
)
occluders = st.builds(
    lambda shape, x, y, z, roll, yaw, rolls: Occluder(
        "part", shape, Pose.from_rpy((x, y, z), roll, 0.3, yaw), rolls
    ),
    shapes, places, places, places, radians, radians, st.booleans(),
)  # fmt: skip


def carry(parts: tuple[Occluder, ...], *mounts: Mount, **sensors: Any) -> Robot:
    robot = replace(rover(), occluders=Occluders(parts))
    return robot.with_sensors(mounts, sensors or {"sonar": RAY})


def holds(shape: Shape, points: Array) -> NDArray[np.bool_]:
    squared = points * points
    if shape.kind == "box":
        return np.asarray((np.abs(points) <= np.array(shape.size) / 2).all(axis=1))
    if shape.kind == "sphere":
        return np.asarray(squared.sum(axis=1) <= shape.size[0] ** 2)
    across = squared[:, :2].sum(axis=1) <= shape.size[0] ** 2
    return np.asarray(across & (np.abs(points[:, 2]) <= shape.size[1] / 2))


def sample(robot: Robot) -> float:
    """Walk along the only ray of the only sensor, until a shape that counts begins."""
    frame = robot.sensor_frames[0]
    way = np.arange(-SAMPLE_M, FAR_M, SAMPLE_M)
    points = frame[:3, 3] + way[:, None] * frame[:3, 0]
    housing = RAY.size_m[0] / 2  # the ray leaves it through its front
    nearest = FAR_M
    for part in robot.occluders.shapes:
        inside = holds(part.shape, (points - part.pose.position) @ part.pose.rotation)
        if part.rolls:
            seen = way[inside & (way >= 0.0)]
        elif inside[0]:
            continue  # of the body in which the sensor sits it sees nothing; all shapes are convex
        else:
            seen = way[inside & (way > housing)]
        nearest = min([nearest, *seen[:1].tolist()])
    return nearest


@pytest.mark.slow
@settings(max_examples=60)
@given(st.lists(occluders, min_size=1, max_size=4).map(tuple), places, places, places, radians)
def test_a_ray_ends_where_a_walk_along_it_meets_the_robot(
    parts: tuple[Occluder, ...], x: float, y: float, z: float, yaw: float
) -> None:
    mount = Mount("sonar", "base_link", x, y, z, math.degrees(yaw), 20.0)
    robot = carry(parts, mount)
    (distance,) = measure_clear_ranges(robot)
    # A shape that is thinner along the ray than the step may be missed by the walk.
    walked = sample(robot)
    if not math.isclose(distance, walked, abs_tol=2.1 * SAMPLE_M):
        ahead = carry(parts, replace(mount, yaw_deg=mount.yaw_deg + 0.05))
        behind = carry(parts, replace(mount, yaw_deg=mount.yaw_deg - 0.05))
        around = sorted(float(measure_clear_ranges(near)[0]) for near in (ahead, behind))
        edge = max(around) - min(around) > SAMPLE_M or max(around) == FAR_M
        surface = min(abs(distance), abs(distance - RAY.size_m[0] / 2)) < 2.1 * SAMPLE_M
        assert edge or surface, (distance, walked)


WALL = (Occluder("base_link", Shape("box", (0.2, 1.0, 1.0)), Pose((0.0, 0.0, 0.5)), False),)


@pytest.mark.parametrize("offset", [-1e-4, -1e-12, 0.0, 1e-12, 1e-4])
def test_a_sensor_on_a_surface_sees_past_it_outwards_and_nothing_inwards(offset: float) -> None:
    half = RAY.size_m[0] / 2
    for yaw, expected in ((0.0, FAR_M), (60.0, FAR_M), (-60.0, FAR_M), (180.0, half)):
        robot = carry(WALL, Mount("sonar", "base_link", 0.1 + offset, 0.0, 0.5, yaw, 0.0))
        assert measure_clear_ranges(robot)[0] == pytest.approx(expected, abs=1e-9), yaw


def test_a_sensor_does_not_see_the_shape_that_describes_it_and_sees_no_way_out_of_a_wheel() -> None:
    shape, pose = Shape("cylinder", (0.05, 0.08)), Pose((0.0, 0.0, 0.3))
    mount = Mount("sonar", "base_link", 0.01, 0.0, 0.3, 0.0, 0.0)
    for rolls, expected in ((False, FAR_M), (True, 0.0)):
        robot = carry((Occluder("scanner", shape, pose, rolls),), mount)
        assert measure_clear_ranges(robot)[0] == expected
        assert bool(list(find_self_sights(robot))) == rolls


def test_the_hidden_share_is_that_of_the_rays() -> None:
    """A wall that begins straight ahead of a lidar hides the beams to its left."""
    wall = Occluder("wall", Shape("box", (0.02, 2.0, 1.0)), Pose((0.5, 1.0, 0.3)), False)
    lidar = Lidar(fov_deg=90.0, beams=10, range_max_m=4.0)
    robot = carry((wall,), Mount("lidar", "base_link", 0.0, 0.0, 0.3, 0.0, 0.0), lidar=lidar)
    (sight,) = find_self_sights(robot)
    assert sight.hidden_share == 0.5
    assert (sight.link, sight.name) == ("wall", "lidar_0")
    assert sight.distance_m == pytest.approx(0.49 / math.cos(math.radians(5.0)))
    ranges = measure_clear_ranges(robot)
    assert (ranges[:5] == lidar.range_max_m).all()
    bearings = np.radians(np.linspace(-45.0, 45.0, 10))[5:]
    assert ranges[5:] == pytest.approx(0.49 / np.cos(bearings))


@pytest.mark.parametrize(("y", "seen"), [(0.0, (0.1, FAR_M)), (0.095, (0.1, 0.1))])
def test_a_robot_hides_by_its_collision_shapes_or_by_what_it_shows(
    y: float, seen: tuple[float, float]
) -> None:
    """The rover's cage is a box for contact, and shown as bars at both sides."""
    mount = Mount("sonar", "base_link", 0.09, y, 0.166, 180.0, 0.0)
    for shapes, expected in zip(("collisions", "visuals"), seen, strict=True):
        robot = load(self_occlusion=shapes).with_sensors([mount], {"sonar": RAY})
        assert measure_clear_ranges(robot)[0] == pytest.approx(expected)


def test_shapes_of_another_kind_are_refused() -> None:
    with pytest.raises(InputError, match=r"robot\.self_occlusion: must be collisions or visuals"):
        load(self_occlusion="all")
