"""The distance that a robot drove: alike in the plane and in engines, free and at a wall."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from rigid_cases import MARKS, RIGID

from evoros.base.arrays import CONTACT, LEG_SIZE, STATE_SIZE, X, Y
from evoros.config.compose import compose
from evoros.failure.protocol import USE, Trigger
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.mission.mission import Mission, Outcome
from evoros.mission.rollout import run_mission
from evoros.mission.triggers import BEGUN, make_row, update_clocks

pytestmark = pytest.mark.usefixtures("closed_engines")

PACE = 0.29  # m/s, which the controller commands
AT_WALL_S = 10.0
WALL = Body("wall", Pose((1.0, 0.0, 0.5)), (Shape("box", (0.2, 8.0, 1.0)),))
PAIRS = [
    ("mujoco", "erle_rover"),
    ("mujoco", "two_wheeler"),
    ("pybullet", "erle_rover"),
    ("gazebo", "two_wheeler"),
]
DRIVEN = [pytest.param(*pair, marks=MARKS.get(pair[0], ())) for pair in PAIRS if pair[0] in RIGID]


@cache
def drive(simulator: str, robot: str, *bodies: Body) -> Outcome:
    """Drive blindly along x for 2 s and the time at the wall."""
    overrides = [f"robot={robot}", f"simulator={simulator}", "controller/avoidance=blind"]
    whole = compose([*overrides, "world=blocks"]).build()
    world = whole.world["blocks"]
    course = replace(
        world.course,
        home_x_m=0.0, home_y_m=0.0, home_z_m=0.02, home_yaw_rad=0.0,
        waypoints=[[30.0, 0.0]], direction="one_way",
        time_limit_s=2.0 + AT_WALL_S, end_on_collision=False,
    )  # fmt: skip
    ground = tuple(body for body in world.bodies if body.is_ground)
    world = replace(world, bodies=(*ground, *bodies), course=course)
    design = whole.space.decode(np.full(whole.space.size, 0.5))
    mission = Mission(0, 0, design, "blocks", 0, "evaluation", "test")
    (outcome,), _ = run_mission(replace(whole.scenario, world={"blocks": world}), mission)
    return outcome


@pytest.mark.parametrize(("engine", "robot"), DRIVEN)
def test_engines_and_the_plane_agree_on_a_free_drive(engine: str, robot: str) -> None:
    in_plane = drive("planar", robot).distance_m
    assert in_plane > 0.9 * PACE * (2.0 + AT_WALL_S)
    assert drive(engine, robot).distance_m == pytest.approx(in_plane, rel=0.01)


@pytest.mark.parametrize(("engine", "robot"), DRIVEN)
def test_ten_seconds_against_a_wall_are_no_way(engine: str, robot: str) -> None:
    """In engines the robot still turns until it is flush with the wall, by some centimetres."""
    in_plane, pushed = drive("planar", robot, WALL), drive(engine, robot, WALL)
    assert max(in_plane.first_collision_s, pushed.first_collision_s) < 2.5
    assert pushed.distance_m == pytest.approx(in_plane.distance_m, abs=0.02 * PACE * AT_WALL_S)
    assert pushed.mean_speed_mps == pytest.approx(pushed.distance_m / (2.0 + AT_WALL_S))


def test_a_battery_is_not_used_up_by_shaking_at_a_wall() -> None:
    """It lasts for 1 m of driving: none that shakes and slides sideways in contact, then 1 m."""
    per_metre = Trigger(USE, (1.0, 0.0, 1.0))
    row = make_row(0, per_metre, (0.0, 0.0), np.array([[9.0, 0.0]]), (0.0, 0.0))
    triggers, state, legs = np.array([row]), np.zeros(STATE_SIZE), np.zeros(LEG_SIZE)
    state[CONTACT] = 1.0
    for k in range(1000):
        state[X], state[Y] = 0.005 * (k % 2), 0.1 * math.sin(0.1 * k)
        update_clocks(np.zeros(2), triggers, np.zeros(1), state, legs, 0.1 * k)
    assert triggers[0, BEGUN] == math.inf
    state[CONTACT] = 0.0
    for k in range(1000, 1050):
        state[X] += 0.019
        update_clocks(np.zeros(2), triggers, np.zeros(1), state, legs, 0.1 * k)
    assert triggers[0, BEGUN] == math.inf
    state[X] += 0.1
    update_clocks(np.zeros(2), triggers, np.zeros(1), state, legs, 105.0)
    assert triggers[0, BEGUN] == 105.0
