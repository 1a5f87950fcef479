"""How deep solids overlap, the lifts at which they do, and the clearance along a track."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from planar_cases import project_obstacles, rover, solids, world_of

from evoros.geometry.clearance import compute_clearances, summarize_track
from evoros.geometry.footprint import Outlines
from evoros.geometry.overlap import Solid, clearance, overlap_depth
from evoros.geometry.shapes import Pose, Shape, Vector, normalize
from evoros.world.standing import outlines

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
