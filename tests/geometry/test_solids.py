"""Convex polyhedra against boxes and scipy's hulls, how deep solids overlap, and clearances."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from planar_cases import project_obstacles, rover, solids, world_of
from scipy.spatial import ConvexHull

from evoros.base.arrays import Array
from evoros.geometry.clearance import compute_clearances, summarize_track
from evoros.geometry.footprint import (
    Outlines,
    bottom_height,
    convex_hull,
    project_bodies,
    project_shape,
    top_height,
)
from evoros.geometry.overlap import Solid, clearance, overlap_depth
from evoros.geometry.polyhedron import (
    convex_polyhedron,
    joint_moments,
    solid_centre,
    solid_moments,
    solid_volume,
)
from evoros.geometry.shapes import Body, Pose, Shape, Vector, normalize
from evoros.world.standing import outlines

unhurried = settings(max_examples=30)
lengths = st.floats(0.05, 3.0)
coordinates = st.floats(-5.0, 5.0)
angles = st.floats(-math.pi, math.pi)
poses = st.builds(
    lambda x, y, z, r, p, w: Pose.from_rpy((x, y, z), r, p, w), *[coordinates] * 3, *[angles] * 3
)
sizes = st.tuples(lengths, lengths, lengths)


def polyhedron(points: Array) -> Shape:
    return Shape("convex", (), corners=tuple((x, y, z) for x, y, z in points.tolist()))


def box_corners(size: Vector) -> Array:
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    corners: Array = signs * np.array(size) / 2
    return corners


rocks = st.builds(
    lambda seed, count: polyhedron(np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 3))),
    st.integers(0, 2**32),
    st.integers(5, 30),
)


@unhurried
@given(sizes, poses)
def test_a_box_of_corners_is_that_box(size: Vector, pose: Pose) -> None:
    box, solid = Shape("box", size), polyhedron(box_corners(size))
    assert len(convex_polyhedron(solid.corners).faces) == 6
    assert bottom_height(solid, pose) == pytest.approx(bottom_height(box, pose), abs=1e-9)
    assert top_height(solid, pose) == pytest.approx(top_height(box, pose), abs=1e-9)
    expected, result = project_shape(box, pose), project_shape(solid, pose)
    gaps = np.linalg.norm(result.vertices[:, None] - expected.vertices, axis=2)
    assert gaps.min(axis=0).max() < 1e-9
    assert gaps.min(axis=1).max() < 1e-9
    assert solid_volume(solid) == pytest.approx(math.prod(size))
    assert solid_centre(solid) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    assert solid_moments(solid, 3.0) == pytest.approx(solid_moments(box, 3.0), rel=1e-6)


@unhurried
@given(rocks, poses, coordinates, lengths)
def test_the_part_between_two_heights_is_projected(
    rock: Shape, pose: Pose, low: float, thickness: float
) -> None:
    """The half-spaces of the hull and of the slab, intersected by sampling."""
    high = low + thickness
    hull = ConvexHull(np.array(rock.corners))
    corners = np.array(rock.corners) @ pose.rotation.T + pose.position
    if corners[:, 2].min() >= high - 1e-3 or corners[:, 2].max() <= low + 1e-3:
        return
    area = project_shape(rock, pose, low, high)
    rng = np.random.default_rng(1)
    points = rng.uniform(corners.min(axis=0), corners.max(axis=0), (4000, 3))
    local = (points - pose.position) @ pose.rotation
    inside = (local @ hull.equations[:, :3].T + hull.equations[:, 3] <= 0.0).all(axis=1)
    inside &= (points[:, 2] >= low) & (points[:, 2] <= high)
    for angle in np.linspace(0.0, 2 * math.pi, 24, endpoint=False):
        direction = np.array([math.cos(angle), math.sin(angle)])
        reach = float((area.vertices @ direction).max())
        assert (points[inside, :2] @ direction).max(initial=-math.inf) <= reach + 1e-9
    # No corner is too far out: each lies above a point of the solid within the slab.
    vertical = pose.rotation[2]
    for x, y in area.vertices.tolist():
        start = (np.array([x, y, 0.0]) - pose.position) @ pose.rotation
        slopes, gaps = hull.equations[:, :3] @ vertical, hull.equations[:, :3] @ start
        limits = -(gaps + hull.equations[:, 3]) + 1e-7
        ceiling = min([high, *(limits[slopes > 1e-12] / slopes[slopes > 1e-12])])
        floor = max([low, *(limits[slopes < -1e-12] / slopes[slopes < -1e-12])])
        assert floor <= ceiling + 1e-3


def test_a_pyramid_counts_at_the_height_of_the_robot() -> None:
    """It stands on its top: 2 m wide at 1 m, so 0.6 m wide at 0.3 m."""
    corners = np.array([[1, 1, 1], [-1, 1, 1], [-1, -1, 1], [1, -1, 1], [0, 0, 0]], float)
    body = Body("top", Pose(), (polyhedron(corners),))
    (whole,), (low,) = project_bodies([body]), project_bodies([body], below_m=0.3)
    assert np.abs(whole.vertices).max() == 1.0
    assert np.abs(low.vertices) == pytest.approx(np.full((4, 2), 0.3))
    sunk = Body("sunk", Pose((0.0, 0.0, -2.0)), (polyhedron(corners),))
    assert project_bodies([sunk]) == ()


@unhurried
@given(rocks)
def test_hulls_are_those_of_scipy(rock: Shape) -> None:
    hull, solid = ConvexHull(np.array(rock.corners)), convex_polyhedron(rock.corners)
    assert solid_volume(rock) == pytest.approx(hull.volume)
    assert len(solid.corners) == len(hull.vertices)
    a, b, c = (solid.corners[solid.triangles[:, i]] for i in range(3))
    outwards = np.cross(b - a, c - a)
    assert ((a - solid.corners.mean(axis=0)) * outwards).sum(axis=1).min() > 0.0
    assert len(solid.edges) == len(solid.triangles) * 3 // 2
    flat = project_shape(rock, Pose()).vertices
    assert ConvexHull(flat).volume == pytest.approx(
        ConvexHull(convex_hull(np.array(rock.corners)[:, :2])).volume
    )


@pytest.mark.slow
@unhurried
@given(rocks, st.integers(0, 2**32))
def test_moments_agree_with_random_points(rock: Shape, seed: int) -> None:
    hull = ConvexHull(np.array(rock.corners))
    points = np.random.default_rng(seed).uniform(-1.0, 1.0, (200_000, 3))
    inside = (points @ hull.equations[:, :3].T + hull.equations[:, 3] <= 0.0).all(axis=1)
    if inside.sum() < 2000:
        return
    points = points[inside]
    centre = points.mean(axis=0)
    away = points - centre
    squared = (away * away).mean(axis=0)
    result = np.array(solid_moments(rock, 1.0))
    assert solid_centre(rock) == pytest.approx(tuple(centre), abs=0.05)
    assert result == pytest.approx(squared.sum() - squared, rel=0.15)


@unhurried
@given(sizes)
def test_two_halves_have_the_moments_of_the_whole(size: Vector) -> None:
    x, y, z = size
    half = box_corners((x / 2, y, z))
    halves = [
        polyhedron(half + np.array([x / 4, 0.0, 0.0])),
        Shape("box", (x / 2, y, z), Pose((-x / 4, 0, 0))),
    ]
    assert joint_moments(halves, 2.0) == pytest.approx(
        solid_moments(Shape("box", size), 2.0), rel=1e-6
    )
    assert solid_moments(Shape("sphere", (x,)), 5.0) == pytest.approx((2 * x * x,) * 3)


def test_a_height_field_covers_its_area() -> None:
    """Row 0 lies at -y, column 0 at -x."""
    field = Shape("heightfield", (4.0, 2.0), heights=((0.0, 1.0, 2.0), (3.0, 4.0, -1.0)))
    pose = Pose((10.0, 0.0, 0.5))
    assert (bottom_height(field, pose), top_height(field, pose)) == (-0.5, 4.5)
    vertices = {tuple(v) for v in project_shape(field, pose).vertices.tolist()}
    assert vertices == {(8.0, -1.0), (12.0, -1.0), (12.0, 1.0), (8.0, 1.0)}


EXACT_M, EXACT = 2e-4, 0.021  # the stated errors of a depth, and a little more
CORNERS = tuple((x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5))
CUBES = {"box": Shape("box", (1.0, 1.0, 1.0)), "convex": Shape("convex", (), corners=CORNERS)}
metres = st.floats(-0.7, 0.7)
places = st.tuples(metres, metres, metres)


def sphere(radius: float, *place: float) -> Solid:
    return Solid.at(Shape("sphere", (radius,)), Pose((place[0], place[1], place[2])))


def cylinder(radius: float, height: float, *place: float) -> Solid:
    return Solid.at(Shape("cylinder", (radius, height)), Pose((place[0], place[1], place[2])))


@pytest.mark.parametrize("first", CUBES)
@pytest.mark.parametrize("second", CUBES)
def test_cubes_overlap_by_the_least_of_three_ways_out(first: str, second: str) -> None:
    at = Solid.at(CUBES[first], Pose((0.9, 0.3, 0.2)))
    other = Solid.at(CUBES[second], Pose())
    assert overlap_depth(at, other) == pytest.approx(0.1)
    assert clearance(at, other) == pytest.approx((-1.2, 0.8))
    aside = Solid.at(CUBES[first], Pose((1.1, 0.3, 0.2)))
    assert overlap_depth(aside, other) == pytest.approx(-0.1)
    assert clearance(aside, other) is None


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(place=places, radii=st.tuples(st.floats(0.05, 20.0), st.floats(0.05, 20.0)))
def test_spheres_are_exact(place: Vector, radii: tuple[float, float]) -> None:
    first, second = sphere(radii[0], *place), sphere(radii[1], 0.0, 0.0, 0.0)
    depth = sum(radii) - math.hypot(*place)
    assert max(overlap_depth(first, second), 0.0) == pytest.approx(
        max(depth, 0.0), abs=EXACT_M, rel=EXACT
    )
    across = math.hypot(place[0], place[1])
    if across < 0.99 * sum(radii):
        reach = math.sqrt(sum(radii) ** 2 - across**2)
        assert clearance(first, second) == pytest.approx(
            (-reach - place[2], reach - place[2]), abs=10 * EXACT_M
        )


@settings(deadline=None, max_examples=40)
@given(offset=st.floats(0.0, 0.9), height=st.floats(0.1, 2.0))
def test_upright_cylinders_overlap_as_their_circles_do(offset: float, height: float) -> None:
    first, second = cylinder(0.3, height, offset, 0.1, 0.0), cylinder(0.4, height, 0.0, 0.0, 0.0)
    depth = min(0.7 - math.hypot(offset, 0.1), height)
    assert max(overlap_depth(first, second), 0.0) == pytest.approx(
        max(depth, 0.0), abs=EXACT_M, rel=EXACT
    )
    assert (clearance(first, second) is None) == (depth <= 0.0)


@settings(deadline=None, max_examples=40)
@given(place=places, turn=st.tuples(*[st.floats(-1.0, 1.0)] * 4), moved=places)
def test_the_depth_is_the_same_from_both_and_in_every_frame(
    place: Vector, turn: tuple[float, float, float, float], moved: Vector
) -> None:
    if math.hypot(*turn) < 0.1:
        return
    poses = Pose(place, normalize(turn)), Pose((0.1, 0.0, 0.2))
    shapes = CUBES["box"], Shape("cylinder", (0.2, 0.9))
    frame = Pose(moved, normalize(turn[::-1]))
    first, second = (Solid.at(s, pose) for s, pose in zip(shapes, poses, strict=True))
    depth = overlap_depth(first, second)
    assert max(overlap_depth(second, first), 0.0) == pytest.approx(
        max(depth, 0.0), abs=EXACT_M, rel=EXACT
    )
    turned = [Solid.at(s, frame @ pose) for s, pose in zip(shapes, poses, strict=True)]
    assert max(overlap_depth(turned[0], turned[1]), 0.0) == pytest.approx(
        max(depth, 0.0), abs=EXACT_M, rel=EXACT
    )


@pytest.mark.slow
@settings(deadline=None, max_examples=40)
@given(place=places, turn=st.tuples(*[st.floats(-1.0, 1.0)] * 4))
def test_a_solid_that_is_lifted_as_far_as_the_clearance_just_touches(
    place: Vector, turn: tuple[float, float, float, float]
) -> None:
    if math.hypot(*turn) < 0.1:
        return
    shape, other = Shape("cylinder", (0.3, 0.5)), sphere(0.4, 0.0, 0.0, 0.0)
    lifts = clearance(Solid.at(shape, Pose(place, normalize(turn))), other)
    if lifts is None:
        return
    for lift in lifts:
        x, y, z = place
        touching = Solid.at(shape, Pose((x, y, z + lift), normalize(turn)))
        assert overlap_depth(touching, other) == pytest.approx(0.0, abs=10 * EXACT_M)
    if lifts.high - lifts.low > 0.1:
        middle = Pose(
            (place[0], place[1], place[2] + (lifts.low + lifts.high) / 2), normalize(turn)
        )
        assert overlap_depth(Solid.at(shape, middle), other) > 0.0


def test_the_farthest_points_of_a_cylinder_lie_on_its_rims() -> None:
    solid = cylinder(0.3, 1.0, 1.0, 2.0, 3.0)
    diagonal = np.array([3.0, 4.0, 1e-3])
    assert solid.farthest(diagonal) == pytest.approx((1.18, 2.24, 3.5))
    low, high = solid.box()
    assert (*low, *high) == pytest.approx((0.7, 1.7, 2.5, 1.3, 2.3, 3.5))


@settings(deadline=None, max_examples=40)
@given(st.lists(solids, min_size=1, max_size=6), st.integers(0, 1000))
def test_the_least_clearance_is_that_of_all_poses(
    placed: list[tuple[Shape, Pose]], seed: int
) -> None:
    robot, world = rover(), world_of(*placed)
    rng = np.random.default_rng(seed)
    steps = rng.normal(0.0, (0.05, 0.05, 0.2), (300, 3))
    poses = np.cumsum(steps, axis=0) + rng.uniform(-5, 5, 3)
    track = np.column_stack((poses, np.zeros(len(poses))))  # without contact
    areas = outlines(world, robot.height_m)
    summary = summarize_track(track, len(track), robot.outline, areas, np.array([[0.0, 0.0]]))
    clearances = compute_clearances(robot.outline, poses, project_obstacles(world, robot))
    assert summary.clearance == clearances.min()
    moved = np.diff(track[:, :2], axis=0)
    assert summary.length == pytest.approx(np.hypot(moved[:, 0], moved[:, 1]).sum())
    assert summary.point_distances[0] == pytest.approx(np.hypot(track[:, 0], track[:, 1]).min())


def test_without_obstacles_there_is_no_clearance() -> None:
    summary = summarize_track(
        np.zeros((3, 4)), 3, rover().outline, Outlines.of([]), np.zeros((0, 2))
    )
    assert summary.clearance == math.inf
    assert summary.length == 0.0
