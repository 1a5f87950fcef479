"""Rays meet the wheels of their own robot where these are, in every engine."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from planar_cases import world_of
from pybullet_cases import box
from rigid_cases import probe
from robot_cases import rover
from team_cases import NAMES, SIMULATORS

from evoros.base.arrays import Array
from evoros.robot.model import Robot
from evoros.robot.outline import Occluders
from evoros.sensor.protocol import Mount
from evoros.sensor.sonar import Sonar
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import PlacedRobot, open_alone
from evoros.world.model import World

pytestmark = pytest.mark.usefixtures("closed_engines")

FRONT_X_M, HALF_TRACK_M, HALF_WIDTH_M = 0.184, 0.1345, 0.028
"""The rover's front wheels, as robots/erle_rover/erle_rover.xacro states them."""

RAY = Sonar(rays_per_axis=1, range_min_m=0.0)


def watch_wheels() -> Robot:
    """The rover with a ray from between its front wheels to each wheel's steering axis.

    The rays start inside the chassis, which they do not see.
    """
    mounts = [
        Mount("sonar", "base_link", FRONT_X_M, 0.0, 0.0635, yaw, 0.0) for yaw in (90.0, -90.0)
    ]
    return rover().with_sensors(mounts, {"sonar": RAY})


def empty_world() -> World:
    world = world_of()
    return replace(world, course=replace(world.course, home_x_m=0.0))


def read(simulation: Any, count: int) -> Array:
    ranges = np.zeros(count)
    simulation.sense(ranges)
    return ranges


@pytest.mark.parametrize("name", NAMES)
def test_a_steered_wheel_is_seen_where_it_is(name: str) -> None:
    """A ray through the axis meets the wheel's face, turned by the angle, at its half width."""
    robot = watch_wheels()
    steering_joints, drive = robot.drive.steering_joints, robot.drive
    with open_alone(SIMULATORS[name]().open, robot, empty_world()) as simulation:
        for steering in (0.0, 0.3, -0.6, -9.0):
            simulation.advance(np.array([0.1, steering]), 1.0)
            angles = np.array(drive.targets(0.0, steering)[0])
            if name != "planar":
                at = probe(simulation).angle
                measured = np.array([at(joint) for joint in steering_joints])
                assert measured == pytest.approx(angles, abs=0.03)
                angles = measured
            expected = HALF_TRACK_M - HALF_WIDTH_M / np.cos(angles)
            assert read(simulation, 2) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_each_of_several_robots_sees_its_own_wheels(name: str) -> None:
    robot = watch_wheels()
    homes = [(0.0, 0.0, 0.0, 0.0), (5.0, 0.0, 0.0, 1.0)]
    placed = [PlacedRobot(robot, home) for home in homes]
    with SIMULATORS[name]().open(placed, empty_world()) as simulation:
        readings = read(simulation, 4)
    assert readings == pytest.approx([HALF_TRACK_M - HALF_WIDTH_M] * 4, abs=1e-3)


@pytest.mark.parametrize("name", NAMES)
def test_what_is_nearer_than_the_robot_is_seen_and_what_is_farther_is_not(name: str) -> None:
    """The cage, 0.1 m behind a sonar that looks back, hides a wall behind the robot."""

    back = Mount("sonar", "base_link", 0.09, 0.0, 0.166, 180.0, 0.0)
    robot = rover().with_sensors([back], {"sonar": RAY})
    bare = replace(robot, occluders=Occluders())
    world = empty_world()
    wall = replace(world, bodies=(*world.bodies, box("wall", -1.0, 0.0, (0.1, 4.0, 1.0))))
    readings = []
    for seen in (robot, bare):
        with open_alone(SIMULATORS[name]().open, seen, wall) as simulation:
            readings.append(float(read(simulation, 1)[0]))
    assert readings == pytest.approx([0.1, 1.04], abs=2e-3)


def test_sensors_that_do_not_see_the_robot_have_the_bits_of_a_robot_without_shapes() -> None:
    """Among the shapes of the study's rover, of which its own regions see none."""
    mounts = [Mount("sonar", "base_link", 0.2, y, 0.166, 200 * y, 12.5) for y in (-0.1, 0.0, 0.1)]
    robot = rover().with_sensors(mounts, {"sonar": Sonar()})
    sensed = []
    for seen in (robot, replace(robot, occluders=Occluders())):
        with open_alone(Planar().open, seen, empty_world()) as simulation:
            simulation.advance(np.array([0.3, 0.4]), 2.0)
            sensed.append((read(simulation, 3).tobytes(), simulation.parameters.tobytes()))
    assert sensed[0] == sensed[1]


@pytest.mark.parametrize("steering", [0.1, 0.5, -0.7])
def test_the_plane_turns_each_wheel_by_the_angle_of_the_drive(steering: float) -> None:
    """Its rule needs one number for each joint, which holds at all angles."""
    robot = watch_wheels()
    with open_alone(Planar(steering_lag_s=0.0).open, robot, empty_world()) as simulation:
        simulation.advance(np.array([0.0, steering]), 0.1)
        angles = np.array(robot.drive.targets(0.0, steering)[0])
        expected = HALF_TRACK_M - HALF_WIDTH_M / np.cos(angles)
        assert read(simulation, 2) == pytest.approx(expected, abs=1e-9)
    assert not math.isclose(*angles.tolist(), abs_tol=1e-3)
