"""The rule of walkers by itself: pace, routes, one another, obstacles, robots."""

import math
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from planar_cases import rover
from walker_cases import crowd_of, open_world, walkers

from evoros.base.arrays import Array
from evoros.compilation.rules import A1, A2, F8, NOTHING, compile_rule, interpret_rule
from evoros.geometry.footprint import Footprint, distances, project_bodies
from evoros.geometry.shapes import Pose, Shape
from evoros.simulator.engines.walking import plan
from evoros.simulator.protocol import PlacedRobot
from evoros.walkers.crowd import Crowd
from evoros.walkers.forces import BLOCKED_S

STEP = 0.02
NO_ROBOTS = np.zeros((0, 4))
RULE = NOTHING(A1, A1, A2, F8, A2)


def walk(
    crowd: Crowd, seconds: float, robots: Array = NO_ROBOTS, interpreted: bool = False
) -> Array:
    """The places (steps, walkers, 2) [m] after each step, and the last memory."""
    rule = interpret_rule(plan) if interpreted else compile_rule(plan, RULE)
    ways = np.zeros((round(seconds / STEP), 2 * len(crowd.names)))
    rule(crowd.parameters, crowd.memory, robots, STEP, ways)
    return ways.reshape(len(ways), -1, 2)


def standing(x: float, y: float, yaw: float = 0.0) -> tuple[PlacedRobot, Array]:
    """A rover that stands somewhere, as crowds and as the rule take it."""
    pose = np.array([[x, y, math.cos(yaw), math.sin(yaw)]])
    return PlacedRobot(rover(), (x, y, 0.0, yaw)), pose


@pytest.mark.parametrize("pace", [0.3, 1.0, 2.0])
def test_the_way_along_a_straight_free_route_is_pace_times_time(pace: float) -> None:
    crowd = crowd_of({"people": walkers(route=[(0.0, 5.0), (60.0, 5.0)], pace_mps=pace)})
    ways = walk(crowd, 10.0)
    times = STEP * np.arange(1, len(ways) + 1)
    assert ways[:, 0, 0] == pytest.approx(pace * times, abs=1e-9)
    assert ways[:, 0, 1] == pytest.approx(5.0, abs=1e-12)


def test_a_route_is_walked_round_and_round() -> None:
    corners = np.array([(0.0, 5.0), (4.0, 5.0), (4.0, 9.0), (0.0, 9.0)])
    crowd = crowd_of({"people": walkers(route=corners.tolist())})
    ways = walk(crowd, 40.0)[:, 0]
    nearest = [np.sqrt(((ways - corner) ** 2).sum(axis=1)) for corner in corners]
    for distance in nearest:
        arrivals = np.count_nonzero((distance[1:] < 0.4) & (distance[:-1] >= 0.4))
        assert arrivals >= 2
    order = np.argmin(np.array(nearest), axis=0)
    turns = np.diff(order)[np.diff(order) != 0] % 4
    assert set(turns.tolist()) == {1}


@given(st.floats(0.5, 2.0), st.floats(0.5, 2.0), st.floats(-0.3, 0.3), st.floats(0.15, 0.4))
@settings(deadline=None, max_examples=40)
def test_two_that_meet_head_on_pass_without_overlap(
    first: float, second: float, aside: float, radius: float
) -> None:
    left = walkers(route=[(0.0, 5.0), (30.0, 5.0)], pace_mps=first, radius_m=radius)
    right = walkers(
        route=[(12.0, 5.0 + aside), (-20.0, 5.0 + aside)], pace_mps=second, radius_m=radius
    )
    crowd = crowd_of({"left": left, "right": right})
    ways = walk(crowd, 12.0 / min(first, second))
    gaps = np.sqrt(((ways[:, 0] - ways[:, 1]) ** 2).sum(axis=1))
    assert gaps.min() >= 2.0 * radius - 1e-9
    assert ways[-1, 0, 0] > ways[-1, 1, 0]  # each is beyond the other


def test_compiled_and_interpreted_give_the_same_bits() -> None:
    world = open_world((Shape("box", (1.0, 1.0, 1.0)), Pose((3.0, 3.0, 0.5))))
    robot, pose = standing(0.0, 0.0)
    group = walkers(number=4, phase="random", avoids_robots=True, stops_for_robots=True)
    crowds = [crowd_of({"people": group}, world, [robot]) for _ in range(2)]
    assert crowds[0].parameters.tobytes() == crowds[1].parameters.tobytes()
    compiled = walk(crowds[0], 6.0, pose)
    assert walk(crowds[1], 6.0, pose, interpreted=True).tobytes() == compiled.tobytes()
    assert crowds[0].memory.tobytes() == crowds[1].memory.tobytes()
    assert np.abs(np.diff(compiled, axis=0)).max() > 0.0


def test_a_walker_goes_round_a_robot_in_its_way() -> None:
    robot, pose = standing(6.0, 5.0, 0.7)
    group = walkers(route=[(0.0, 5.0), (40.0, 5.0)], avoids_robots=True)
    ways = walk(crowd_of({"people": group}, robots=[robot]), 14.0, pose)[:, 0]
    area = project_outline(robot)
    assert distances(area, ways).min() > group.radius_m
    assert ways[-1, 0] > 10.0


def project_outline(robot: PlacedRobot) -> Footprint:
    x, y, _, yaw = robot.home
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    return Footprint(robot.robot.outline @ turn.T + (x, y))


def test_one_that_stops_stands_while_a_robot_is_near_and_walks_on_when_it_leaves() -> None:
    robot, pose = standing(6.0, 5.0)
    gap = 1.0
    group = walkers(
        route=[(0.0, 5.0), (40.0, 5.0)], stops_for_robots=True, stop_distance_m=gap, patience_s=60.0
    )
    crowd = crowd_of({"people": group}, robots=[robot])
    ways = walk(crowd, 30.0, pose)[:, 0]
    left = distances(project_outline(robot), ways[-1:])[0] - group.radius_m
    assert 0.0 < left < gap
    assert np.abs(np.diff(ways[-100:], axis=0)).max() < 1e-6
    gone = pose + np.array([0.0, 50.0, 0.0, 0.0])
    later = walk(crowd, 5.0, gone)[:, 0]
    assert later[-1, 0] - ways[-1, 0] > 3.0


def test_patience_ends_and_the_walker_goes_round() -> None:
    robot, pose = standing(6.0, 5.0)
    group = walkers(
        route=[(0.0, 5.0), (40.0, 5.0)], stops_for_robots=True, patience_s=2.0, avoids_robots=True
    )
    ways = walk(crowd_of({"people": group}, robots=[robot]), 20.0, pose)[:, 0]
    assert ways[-1, 0] > 9.0


@given(st.integers(0, 10_000))
@settings(deadline=None, max_examples=15)
def test_nobody_walks_into_walls_or_others_or_freezes(seed: int) -> None:
    """In a yard with boxes, for two minutes."""
    rng = np.random.default_rng(seed)
    walls = [
        (Shape("box", (12.0, 0.2, 1.0)), Pose((0.0, side * 6.0, 0.5))) for side in (-1.0, 1.0)
    ] + [(Shape("box", (0.2, 12.0, 1.0)), Pose((side * 6.0, 0.0, 0.5))) for side in (-1.0, 1.0)]
    boxes = [
        (Shape("box", (1.0, 2.0, 1.0)), Pose.from_rpy((x, y, 0.5), 0.0, 0.0, yaw))
        for x, y, yaw in (rng.uniform(-1, 1, (4, 3)) * (4.0, 4.0, 3.0)).tolist()
        if math.hypot(x, y) > 1.8 and math.hypot(x - 1, y) > 1.2  # free home and waypoint
    ]
    world = open_world(*walls, *boxes)
    group = walkers(number=6, phase="random", pace_mps=[0.7, 1.5])
    crowd = crowd_of({"people": group}, world, draws=f"{seed}")
    ways = walk(crowd, 120.0)
    for i, j in combinations(range(6), 2):
        assert np.sqrt(((ways[:, i] - ways[:, j]) ** 2).sum(axis=1)).min() >= 0.5 - 1e-9
    for area in project_bodies(world.obstacles, group.height_m):
        assert distances(area, ways.reshape(-1, 2)).min() >= group.radius_m - 1e-9
    span = round(20.0 / STEP)
    for i in range(6):
        for start in range(0, len(ways) - span, span):
            part = ways[start : start + span, i]
            assert np.ptp(part, axis=0).max() > 0.5, (seed, i, start * STEP)


def test_a_walker_stops_at_a_robot_that_it_touches_and_turns_back() -> None:
    robot, pose = standing(6.0, 5.0)
    group = walkers(route=[(0.0, 5.0), (40.0, 5.0)])
    ways = walk(crowd_of({"people": group}, robots=[robot]), 16.0, pose)[:, 0]
    gap = distances(project_outline(robot), ways).min()
    assert group.radius_m - STEP * 1.3 <= gap < group.radius_m  # it overlaps by a step at most
    there = ways[:, 0].argmax() * STEP
    assert ways[round((there + BLOCKED_S - 1.0) / STEP), 0] == pytest.approx(
        ways[:, 0].max(), abs=0.2
    )
    assert ways[-1, 0] < 2.0
