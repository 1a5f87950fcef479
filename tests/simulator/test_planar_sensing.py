"""The sensors of the planar simulator, against rays that are traced in another way."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from planar_cases import angles, coordinates, rover, solids, start, world_of
from scipy.spatial import ConvexHull

from evoros.base.arrays import Array
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.robot.model import Robot
from evoros.sensor.protocol import sees
from evoros.world.model import World


def rotation_about_z(yaw: float) -> Array:
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def trace_readings(world: World, pose: Sequence[float], robot: Robot) -> Array:
    """The readings by bisection along each ray, knowing only what is inside of a solid."""
    x, y, yaw = pose
    turn = rotation_about_z(yaw)
    readings = []
    for mount, frame in zip(robot.mounts, robot.sensor_frames, strict=True):
        sensor = robot.sensors[mount.sensor]
        assert sees(sensor)
        start = turn @ frame[:3, 3] + (x, y, 0.0)
        rays = sensor.rays() @ (turn @ frame[:3, :3]).T
        best = sensor.range_max_m
        for ray in rays:
            for body in world.obstacles:
                hit = _first_inside(body, start, ray, best)
                best = min(best, hit)
            if start[2] + best * ray[2] < 0.0:
                best = -start[2] / ray[2]
        readings.append(max(best, sensor.range_min_m))
    return np.array(readings)


def _first_inside(body: Body, start: Array, ray: Array, best: float) -> float:
    """Least distance at which the ray is inside; infinity where it starts inside."""
    steps = np.arange(0.0, best + 0.002, 0.002)
    (shape,) = body.shapes
    local = (start + steps[:, None] * ray - body.pose.position) @ body.pose.rotation
    inside = _inside(shape, local)
    if inside[0] or not inside.any():
        return math.inf
    high = steps[inside.argmax()]
    low = high - 0.002
    for _ in range(40):
        middle = (low + high) / 2
        at = (start + middle * ray - body.pose.position) @ body.pose.rotation
        low, high = (low, middle) if _inside(shape, at[None])[0] else (middle, high)
    return float(high)


def _inside(shape: Shape, points: Array, margin: float = 0.0) -> NDArray[np.bool_]:
    squared = points * points
    if shape.kind == "box":
        inside = np.abs(points) <= np.array(shape.size) / 2
    elif shape.kind == "sphere":
        inside = squared.sum(axis=1, keepdims=True) <= shape.size[0] ** 2
    elif shape.kind == "convex":
        planes = ConvexHull(np.array(shape.corners)).equations
        inside = points @ planes[:, :3].T + planes[:, 3] <= margin
    else:
        across = squared[:, :2].sum(axis=1) <= shape.size[0] ** 2
        inside = np.stack([across, np.abs(points[:, 2]) <= shape.size[1] / 2], axis=1)
    return np.asarray(inside.all(axis=1), dtype=np.bool_)


@pytest.mark.slow
@settings(deadline=None, max_examples=15)
@given(st.lists(solids, max_size=6), coordinates, coordinates, angles, st.floats(-20.0, 30.0))
def test_readings_are_the_nearest_hits(
    placed: list[tuple[Shape, Pose]], x: float, y: float, yaw: float, pitch: float
) -> None:
    robot = rover((0.2, 0.1, 0.166, 30.0, pitch), (0.0, -0.15, 0.1, -90.0, 12.5), rays_per_axis=3)
    world = world_of(*placed)
    readings = np.zeros(2)
    simulation = start(world, robot, (x, y, yaw))
    simulation.sense(readings)
    expected = trace_readings(world, (x, y, yaw), robot)
    # The tracing misses what is thinner along a ray than its step; it never sees what is not.
    assert (readings <= expected + 1e-9).all()
    nearer = readings < expected - 1e-9
    for reading, frame in zip(readings[nearer], robot.sensor_frames[nearer], strict=True):
        assert _grazes(world, (x, y, yaw), frame, reading, robot)


def _grazes(
    world: World, pose: Sequence[float], frame: Array, reading: float, robot: Robot
) -> bool:
    """Whether at this distance along some ray a solid begins that the ray leaves very soon."""
    x, y, yaw = pose
    turn = rotation_about_z(yaw)
    start = turn @ frame[:3, 3] + (x, y, 0.0)
    sonar = robot.sensors["sonar"]
    assert sees(sonar)
    rays = sonar.rays() @ (turn @ frame[:3, :3]).T
    # What is nearer than the minimum is reported there.
    clipped = reading <= sonar.range_min_m
    along = np.linspace(0.0, reading, 6001) if clipped else np.array([reading])
    for body in world.obstacles:
        (shape,) = body.shapes
        grown = replace(shape, size=tuple(edge + 1e-6 for edge in shape.size))
        hits = start + (along[:, None, None] * rays).reshape(-1, 3)
        if _inside(grown, (hits - body.pose.position) @ body.pose.rotation, 1e-6).any():
            return True
    return False


def test_level_ground_is_seen_where_the_lowest_ray_meets_it() -> None:
    """From 0.166 m above ground; the lowest ray is the one at the lower corner of the beam."""
    readings = np.zeros(2)
    poses = ((0.2, 0.0, 0.166, 0.0, 12.5), (0.2, 0.0, 0.166, 0.0, 16.0))
    start(world_of(), rover(*poses)).sense(readings)
    edge, pitch = math.radians(15.0), math.radians(12.5)
    falls = math.cos(pitch) * math.sin(edge) - math.sin(pitch) * math.cos(edge) ** 2
    assert readings[0] == pytest.approx(0.166 / falls)
    assert readings[1] == 4.5


def test_a_sensor_inside_an_obstacle_does_not_see_it() -> None:
    around = Shape("box", (2.0, 2.0, 2.0)), Pose((0.0, 0.0, 0.5))
    ahead = Shape("box", (0.2, 2.0, 2.0)), Pose((3.1, 0.0, 1.0))
    readings = np.zeros(1)
    start(world_of(around, ahead), rover((0.2, 0.0, 0.166, 0.0, 16.0))).sense(readings)
    straight = 3.0 - 0.2
    assert straight <= readings[0] < straight / math.cos(math.radians(31.0))
