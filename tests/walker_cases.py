"""Walkers, and worlds and simulations in which they walk, for tests."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from planar_cases import world_of

from evoros.base.arrays import STATE_SIZE, Array
from evoros.base.rng import generator
from evoros.simulator.protocol import PlacedRobot, Simulation, Simulator
from evoros.walkers.crowd import EVEN, Crowd, Walkers
from evoros.walkers.layout import REPORT_SIZE
from evoros.world.crowds import Standing, draw_crowd
from evoros.world.model import World


def walkers(**values: Any) -> Walkers:
    """One walker of 1 m/s that starts at the first corner of its route, and minds no robot."""
    plain: dict[str, Any] = {"number": 1, "pace_mps": 1.0, "phase": EVEN, "avoids_robots": False}
    return Walkers(**plain | values)


def open_world(*placed: Any) -> World:
    """Level ground, with home at its origin, and shapes at their poses."""
    world = world_of(*placed)
    course = replace(world.course, home_x_m=0.0, home_y_m=0.0, waypoints=((1.0, 0.0),))
    return replace(world, course=course)


def crowd_of(
    groups: Mapping[str, Walkers],
    world: World | None = None,
    robots: Sequence[PlacedRobot] = (),
    draws: str = "draws",
) -> Crowd:
    standing = [Standing(robot.outline, (x, y, yaw)) for robot, (x, y, _, yaw) in robots]
    return draw_crowd(world or open_world(), groups, standing, partial(generator, draws))


@contextmanager
def walking(
    simulator: Simulator, robots: Sequence[PlacedRobot], world: World, **groups: Walkers
) -> Iterator[Simulation]:
    """Open a simulation of robots among walkers."""
    crowd = crowd_of(groups, world, robots)
    with simulator.open(robots, world.with_crowd(crowd)) as simulation:
        yield simulation


def report(simulation: Simulation, robots: int, count: int) -> tuple[Array, Array]:
    """Return the states (robots, STATE_SIZE) and the reports (count, REPORT_SIZE)."""
    states = np.zeros(robots * STATE_SIZE + count * REPORT_SIZE)
    simulation.observe(states)
    first, rest = np.split(states, [robots * STATE_SIZE])
    return first.reshape(robots, -1), rest.reshape(count, -1)
