"""Footprints and clearances, compared with independent formulas and samplings."""

import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog, minimize
from scipy.spatial.transform import Rotation

from evoros.base.arrays import Array
from evoros.geometry.clearance import compute_clearances
from evoros.geometry.footprint import (
    Footprint,
    bottom_height,
    contains,
    convex_hull,
    project_bodies,
    project_shape,
)
from evoros.geometry.shapes import Body, Pose, Shape

# Other programs on the machine decide how long an example takes.
unhurried = settings(deadline=None)

ROVER = np.array([[-0.215, -0.1625], [0.25, -0.1625], [0.25, 0.1625], [-0.215, 0.1625]])
lengths = st.floats(0.05, 5.0)
coordinates = st.floats(-10.0, 10.0)
angles = st.floats(-math.pi, math.pi)
poses = st.builds(
    lambda x, y, z, r, p, w: Pose.from_rpy((x, y, z), r, p, w), *[coordinates] * 3, *[angles] * 3
)
planar_poses = st.tuples(coordinates, coordinates, angles)
shapes = st.one_of(
    st.builds(lambda x, y, z: Shape("box", (x, y, z)), lengths, lengths, lengths),
    st.builds(lambda r, h: Shape("cylinder", (r, h)), lengths, lengths),
    st.builds(lambda r: Shape("sphere", (r,)), lengths),
)


def placed(outline: Array, pose: tuple[float, float, float]) -> Array:
    x, y, yaw = pose
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    moved: Array = outline @ turn.T + (x, y)
    return moved


def one_clearance(outline: Array, pose: tuple[float, float, float], *areas: Footprint) -> float:
    return float(compute_clearances(outline, np.array([pose]), areas)[0])


def surface(shape: Shape, pose: Pose, rng: np.random.Generator, count: int = 2000) -> Array:
    """Random points of a solid, extreme ones among them, by their definition."""
    unit = rng.normal(size=(count, 3))
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    if shape.kind == "sphere":
        local = unit * shape.size[0]
    elif shape.kind == "box":
        local = np.sign(unit) * np.array(shape.size) / 2
    else:
        radius, length = shape.size
        turn = rng.uniform(0, 2 * math.pi, count)
        local = np.stack(
            [radius * np.cos(turn), radius * np.sin(turn), np.sign(unit[:, 2]) * length / 2], axis=1
        )
    points: Array = Rotation.from_quat(pose.quaternion).apply(local) + pose.position
    return points


@unhurried
@given(shapes, poses, st.integers(0, 2**32))
def test_a_footprint_is_the_projection_of_the_solid(shape: Shape, pose: Pose, seed: int) -> None:
    points = surface(shape, pose, np.random.default_rng(seed))
    area = project_shape(shape, pose)
    # In every direction the footprint reaches as far as the solid, and (nearly) no farther.
    for angle in np.linspace(0, 2 * math.pi, 16, endpoint=False):
        direction = np.array([math.cos(angle), math.sin(angle)])
        local = Rotation.from_quat(pose.quaternion).inv().apply([*direction, 0.0])
        if shape.kind == "box":
            support = float(np.abs(local) @ shape.size) / 2
        elif shape.kind == "sphere":
            support = shape.size[0]
        else:
            support = shape.size[0] * math.hypot(*local[:2]) + shape.size[1] / 2 * abs(local[2])
        center = float(direction @ pose.position[:2])
        reached = float((area.vertices @ direction).max()) + area.radius - center
        excess = 0.0013 * shape.size[0] if shape.kind == "cylinder" else 0.0
        assert support - 1e-9 <= reached <= support + excess + 1e-9
        assert (points[:, :2] @ direction).max() <= reached + center + 1e-9
    assert points[:, 2].min() >= bottom_height(shape, pose) - 1e-9


@unhurried
@given(lengths, lengths, coordinates, coordinates, angles)
@example(0.05, 0.05, 0.0, 0.0, 1e-6)
def test_standing_and_lying_cylinders_are_exact(
    radius: float, length: float, x: float, y: float, yaw: float
) -> None:
    cylinder = Shape("cylinder", (radius, length))
    standing = project_shape(cylinder, Pose.from_rpy((x, y, 1.0), 0.0, 0.0, yaw))
    assert standing.radius == radius
    np.testing.assert_allclose(standing.vertices, [[x, y]], atol=1e-12)
    lying = project_shape(cylinder, Pose.from_rpy((x, y, 1.0), 0.0, math.pi / 2, yaw))
    corners = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) * (length / 2, radius)
    expected = placed(corners, (x, y, yaw))
    assert lying.radius == 0
    gaps = np.linalg.norm(lying.vertices[:, None] - expected, axis=2)
    assert len(lying.vertices) == 4
    assert gaps.min(axis=0).max() < 1e-9


@unhurried
@given(st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=30))
@example([(0.0, 0.0), (0.0, -1.0), (-1e-68, 0.0)])
@example([(0.5 + 1e-16, 0.5), (0.5, -0.5), (-0.5, 0.5), (-0.5 - 1e-16, -0.5), (0.5, 0.5 + 1e-16)])
def test_the_hull_is_convex_and_holds_all_points(points: list[tuple[float, float]]) -> None:
    hull = convex_hull(np.array(points))
    assert {tuple(p) for p in hull.tolist()} <= set(points)
    for point in points:
        assert contains(Footprint(hull, 1e-9), point)
    if len(hull) > 2:
        edges = np.roll(hull, -1, axis=0) - hull
        following = np.roll(edges, -1, axis=0)
        turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]
        assert turns.min() > -1e-9


def polygon_distance(a: Array, b: Array) -> float:
    """By quadratic programming over the convex combinations of the corners."""

    def squared(weights: Array) -> float:
        gap = weights[: len(a)] @ a - weights[len(a) :] @ b
        return float(gap @ gap)

    start = np.concatenate([np.full(len(a), 1 / len(a)), np.full(len(b), 1 / len(b))])
    result = minimize(
        squared,
        start,
        bounds=[(0, 1)] * len(start),
        constraints=[
            {"type": "eq", "fun": lambda w: w[: len(a)].sum() - 1},
            {"type": "eq", "fun": lambda w: w[len(a) :].sum() - 1},
        ],
        options={"ftol": 1e-14, "maxiter": 300},
    )
    return math.sqrt(result.fun)


def intersect(a: Array, b: Array) -> bool:
    """By linear programming: is there a point that is a convex combination of both?"""
    equal = np.block(
        [
            [a.T, -b.T],
            [np.ones((1, len(a))), np.zeros((1, len(b)))],
            [np.zeros((1, len(a))), np.ones((1, len(b)))],
        ]
    )
    solved = linprog(np.zeros(len(a) + len(b)), A_eq=equal, b_eq=[0, 0, 1, 1], bounds=(0, None))
    return bool(solved.status == 0)


@settings(max_examples=30)
@given(planar_poses, st.tuples(lengths, lengths), planar_poses, st.sampled_from([1, 2, 4]))
def test_the_clearance_is_the_distance_of_the_polygons(
    robot: tuple[float, float, float],
    size: tuple[float, float],
    other: tuple[float, float, float],
    corners: int,
) -> None:
    box = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])[:corners] * size
    obstacle = placed(box, (0.3 * other[0], 0.3 * other[1], other[2]))
    near = (0.3 * robot[0], 0.3 * robot[1], robot[2])
    clearance = one_clearance(ROVER, near, Footprint(obstacle))
    outline = placed(ROVER, near)
    assert clearance == pytest.approx(polygon_distance(outline, obstacle), abs=2e-4)
    if clearance == 0 or clearance > 1e-6:
        assert (clearance == 0) == intersect(outline, obstacle)


@unhurried
@given(
    st.lists(st.tuples(shapes, poses), min_size=1, max_size=8),
    st.lists(planar_poses, min_size=1, max_size=8),
    planar_poses,
)
def test_moving_everything_alike_changes_no_clearance(
    solids: list[tuple[Shape, Pose]],
    robot: list[tuple[float, float, float]],
    motion: tuple[float, float, float],
) -> None:
    x, y, yaw = motion
    move = Pose.from_rpy((x, y, 0.0), 0.0, 0.0, yaw)
    areas = [project_shape(shape, pose) for shape, pose in solids]
    moved = [project_shape(shape, move @ pose) for shape, pose in solids]
    path = np.array(robot)
    other = np.column_stack([placed(path[:, :2], motion), path[:, 2] + yaw])
    # The circumscribed polygon of a tilted cylinder turns with it, so this holds for all shapes.
    np.testing.assert_allclose(
        compute_clearances(ROVER, path, areas), compute_clearances(ROVER, other, moved), atol=1e-9
    )


@unhurried
@given(planar_poses, planar_poses, lengths, lengths)
def test_the_distance_is_the_same_from_both_sides(
    a: tuple[float, float, float], b: tuple[float, float, float], length: float, width: float
) -> None:
    other = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (length, width)
    there = one_clearance(ROVER, a, Footprint(placed(other, b)))
    back = one_clearance(other, b, Footprint(placed(ROVER, a)))
    assert there == pytest.approx(back, abs=1e-9)


@unhurried
@given(st.lists(st.tuples(shapes, poses), min_size=1, max_size=10), st.integers(0, 2**32))
def test_many_obstacles_and_poses_at_once_are_the_least_of_each_alone(
    solids: list[tuple[Shape, Pose]], seed: int
) -> None:
    path = np.random.default_rng(seed).uniform(-12, 12, (6, 3))
    areas = [project_shape(shape, pose) for shape, pose in solids]
    distances = [[one_clearance(ROVER, tuple(pose), area) for area in areas] for pose in path]
    np.testing.assert_array_equal(compute_clearances(ROVER, path, areas), np.min(distances, axis=1))


@unhurried
@given(planar_poses, st.floats(0.01, 3.0), st.floats(0.0, 5.0), st.booleans())
def test_beside_a_wall_and_before_a_post_it_is_plain_arithmetic(
    frame: tuple[float, float, float], radius: float, gap: float, post: bool
) -> None:
    x, y, yaw = frame
    ahead = 0.25 + gap + radius
    center = placed(np.array([[ahead, 0.0]]), frame)[0]
    pose = Pose.from_rpy((float(center[0]), float(center[1]), 0.0), 0.0, 0.0, yaw)
    shape = Shape("cylinder", (radius, 1.0)) if post else Shape("box", (2 * radius, 7.5, 2.8))
    assert one_clearance(ROVER, (x, y, yaw), project_shape(shape, pose)) == pytest.approx(
        gap, abs=1e-9
    )


def test_crossing_without_a_corner_inside_is_contact() -> None:
    wall = project_shape(Shape("box", (0.01, 20.0, 1.0)), Pose())
    assert one_clearance(ROVER, (0.0, 0.0, 0.3), wall) == 0.0
    assert one_clearance(ROVER, (0.0, 3.0, 0.0), wall) == 0.0


def test_no_obstacle_is_infinitely_far() -> None:
    assert one_clearance(ROVER, (0.0, 0.0, 0.0)) == math.inf
    assert compute_clearances(ROVER, np.zeros((0, 3)), []).shape == (0,)


@unhurried
@given(shapes, poses, coordinates, coordinates)
def test_contains_agrees_with_the_distance_of_a_point(
    shape: Shape, pose: Pose, x: float, y: float
) -> None:
    area = project_shape(shape, pose)
    speck = np.array([[0.0, 0.0], [1e-9, 0.0], [0.0, 1e-9]])
    distance = one_clearance(speck, (x, y, 0.0), area)
    assume(not 0 < distance < 1e-6)
    inside = contains(area, (x, y))
    assert inside == (distance == 0) or distance < 1e-8
    assert contains(area, pose.position[:2])


def test_only_what_hangs_low_has_a_footprint() -> None:
    def board(name: str, height: float) -> Body:
        return Body(name, Pose((0.0, 0.0, height)), (Shape("box", (1.0, 1.0, 0.2)),))

    ground = Body("ground", Pose(), (Shape("plane", (0.0, 0.0, 1.0)),))
    bodies = [ground, board("low", 0.3), board("high", 0.5)]
    assert len(project_bodies(bodies)) == 2
    assert len(project_bodies(bodies, below_m=0.3)) == 1
