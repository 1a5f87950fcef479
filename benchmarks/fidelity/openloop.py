"""Drives a robot open loop with given commands, in any simulator."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from evoros.base.arrays import STATE_SIZE, YAW, Array, X, Y
from evoros.evolution.experiment import Experiment
from evoros.robot.model import Robot
from evoros.simulator.protocol import Simulator, open_alone
from evoros.world.model import World

PERIOD = 0.1  # [s] between commands
Manoeuvre = Callable[[float], tuple[float, float]]
"""Speed [m/s] and steering [rad] at a time [s]."""


def open_ground(experiment: Experiment) -> World:
    """Level ground without obstacles; the robot starts at the origin and faces along x."""
    world = next(iter(experiment.world.values()))
    ground = tuple(body for body in world.bodies if body.is_ground)
    course = replace(world.course, home_x_m=0.0, home_y_m=0.0, home_z_m=0.0, home_yaw_rad=0.0)
    return replace(world, bodies=ground, course=course)


def commands(manoeuvre: Manoeuvre, seconds: float) -> Array:
    """The commands (n, 2) of a manoeuvre, one for each period."""
    return np.array([manoeuvre(tick * PERIOD) for tick in range(round(seconds / PERIOD))])


def drive(
    simulator: Simulator, robot: Robot, world: World, wanted: Array, heading: float = 0.0
) -> Array:
    """Drive the commands ``wanted`` (n, 2); returns a track (n + 1, STATE_SIZE).

    The track has the state before each command and the last one. The robot starts at the world's
    home with ``heading`` [rad]. States are relative to the start, so that tracks with different
    headings can be compared.
    """
    course = replace(world.course, home_yaw_rad=heading)
    states = np.zeros((len(wanted) + 1, STATE_SIZE))
    with open_alone(simulator.open, robot, replace(world, course=course)) as simulation:
        for state, command in zip(states, wanted, strict=False):
            simulation.observe(state)
            simulation.advance(command, PERIOD)
        simulation.observe(states[-1])
    x, y = states[:, X] - course.home_x_m, states[:, Y] - course.home_y_m
    states[:, X] = np.cos(heading) * x + np.sin(heading) * y
    states[:, Y] = np.cos(heading) * y - np.sin(heading) * x
    states[:, YAW] = np.unwrap(states[:, YAW]) - heading
    return states


def distances(track: Array, other: Array) -> Array:
    """The distance (n,) [m] between two tracks at the same times."""
    x, y = track[:, X] - other[:, X], track[:, Y] - other[:, Y]
    return np.asarray(np.sqrt(x * x + y * y))


def length(track: Array) -> float:
    """The length [m] of a track."""
    steps = np.diff(track[:, [X, Y]], axis=0)
    return float(np.sqrt((steps * steps).sum(axis=1)).sum())
