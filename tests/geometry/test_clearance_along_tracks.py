"""The clearance along a track is the minimum over its poses."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from planar_cases import project_obstacles, rover, solids, world_of

from evoros.geometry.clearance import compute_clearances, summarize_track
from evoros.geometry.footprint import Outlines
from evoros.geometry.shapes import Pose, Shape
from evoros.world.standing import outlines


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
