"""A robot driven by given commands, whatever it meets: the same for every simulator."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from evoros.base.arrays import STATE_SIZE, YAW, Array, X, Y
from evoros.evolution.experiment import Experiment
from evoros.robot.model import Robot
from evoros.simulator.protocol import Simulator
from evoros.world.model import World

PERIOD = 0.1  # of the commands [s]
Manoeuvre = Callable[[float], tuple[float, float]]
"""Speed [m/s] and steering [rad] at a time [s]."""


def open_ground(experiment: Experiment) -> World:
    """Level ground without obstacles; the robot stands on it at the origin and faces along x."""
    world = next(iter(experiment.world.values()))
    ground = tuple(body for body in world.bodies if body.is_ground)
    course = replace(world.course, home_x_m=0.0, home_y_m=0.0, home_z_m=0.0, home_yaw_rad=0.0)
    return replace(world, bodies=ground, course=course)


def commands(manoeuvre: Manoeuvre, seconds: float) -> Array:
    """(n, 2): a row for each period."""
    return np.array([manoeuvre(tick * PERIOD) for tick in range(round(seconds / PERIOD))])


def drive(
    simulator: Simulator, robot: Robot, world: World, wanted: Array, heading: float = 0.0
) -> Array:
    """(n + 1, STATE_SIZE): the states before each of the commands (n, 2), and the last.

    The robot starts at the world's home, turned to ``heading`` [rad]. States are seen from where
    it starts, so that tracks under different headings compare.
    """
    course = replace(world.course, home_yaw_rad=heading)
    states = np.zeros((len(wanted) + 1, STATE_SIZE))
    with simulator.open(robot, replace(world, course=course)) as simulation:
        for state, command in zip(states, wanted, strict=False):
            simulation.observe(state)
            simulation.advance(command, PERIOD)
        simulation.observe(states[-1])
    x, y = states[:, X] - course.home_x_m, states[:, Y] - course.home_y_m
    states[:, X] = np.cos(heading) * x + np.sin(heading) * y
    states[:, Y] = np.cos(heading) * y - np.sin(heading) * x
    states[:, YAW] = np.unwrap(states[:, YAW]) - heading
    return states


def apart(track: Array, other: Array) -> Array:
    """(n,) distance [m] between two tracks at the same time."""
    x, y = track[:, X] - other[:, X], track[:, Y] - other[:, Y]
    return np.asarray(np.sqrt(x * x + y * y))


def way(track: Array) -> float:
    """Length [m] of a track."""
    steps = np.diff(track[:, [X, Y]], axis=0)
    return float(np.sqrt((steps * steps).sum(axis=1)).sum())
