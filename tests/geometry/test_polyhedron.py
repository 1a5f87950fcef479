"""Convex polyhedra, compared with the formulas of boxes, with scipy's hulls and with sampling."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from evoros.base.arrays import Array
from evoros.geometry.footprint import (
    bottom_height,
    convex_hull,
    project_bodies,
    project_shape,
    top_height,
)
from evoros.geometry.polyhedron import (
    convex_polyhedron,
    joint_moments,
    solid_centre,
    solid_moments,
    solid_volume,
)
from evoros.geometry.shapes import Body, Pose, Shape, Vector

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
