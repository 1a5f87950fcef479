"""A sensor sees its own robot: where rays meet it, by a reference that knows no formula."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from robot_cases import load, rover

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.geometry.shapes import Pose, Shape
from evoros.robot.model import Robot
from evoros.robot.outline import Occluder, Occluders
from evoros.robot.self_sight import find_self_sights, measure_clear_ranges
from evoros.sensor.lidar import Lidar
from evoros.sensor.protocol import Mount
from evoros.sensor.sonar import Sonar

SAMPLE_M = 1e-3
RAY = Sonar(rays_per_axis=1)
FAR_M = RAY.range_max_m

lengths = st.floats(0.04, 0.3)
places = st.floats(-0.4, 0.4)
angles = st.floats(-math.pi, math.pi)
shapes = st.one_of(
    st.builds(lambda x, y, z: Shape("box", (x, y, z)), lengths, lengths, lengths),
    st.builds(lambda r, h: Shape("cylinder", (r, h)), lengths, lengths),
    st.builds(lambda r: Shape("sphere", (r,)), lengths),
)
occluders = st.builds(
    lambda shape, x, y, z, roll, yaw, rolls: Occluder(
        "part", shape, Pose.from_rpy((x, y, z), roll, 0.3, yaw), rolls
    ),
    shapes, places, places, places, angles, angles, st.booleans(),
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
@given(st.lists(occluders, min_size=1, max_size=4).map(tuple), places, places, places, angles)
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
