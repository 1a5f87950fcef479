"""Several robots in a world, for the tests of all simulators."""

import math
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest
from planar_cases import experiment
from rigid_cases import MARKS, RIGID

from evoros.base.arrays import COMMAND_SIZE, CONTACT, STATE_SIZE, Array
from evoros.config.compose import compose
from evoros.robot.model import Robot
from evoros.sensor.protocol import Mount, Sensor
from evoros.sensor.sonar import Sonar
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import PlacedRobot, Simulation
from evoros.world.model import World

Place = tuple[float, float, float, float]
SIMULATORS: dict[str, Any] = {"planar": Planar, **RIGID}
NAMES = [pytest.param(name, marks=MARKS.get(name, ())) for name in SIMULATORS]
STEP = 0.05  # [s], a multiple of the time step of each simulator made by ``create``
FRONTS = {"erle_rover": 0.25, "mule": 0.28, "courier": 0.19}
"""How far [m] each robot reaches ahead of its origin."""
WHEELS = {"erle_rover": 4.5, "mule": 4.5, "courier": 0.135}
"""How far [m] a ray from there sees to the left; only the courier has a wheel beside its origin."""


def create(name: str) -> Any:
    return SIMULATORS[name](time_step=0.025 if name == "pybullet" else 0.01)


@cache
def load(name: str) -> Robot:
    if name == "erle_rover":
        return experiment().robot
    return compose([f"robot={name}", "design=around", "simulator=planar"]).build().robot


def equip(name: str, *poses: Place, **others: tuple[Sensor, Place]) -> Robot:
    """A robot with single rays, and other sensors, at x, y, z [m], yaw [deg] in its frame."""
    robot = load(name)
    x0, y0, z0, _ = robot.sensor_links[robot.mount_link]
    placed = [("sonar", pose) for pose in poses] + [
        (key, other[1]) for key, other in others.items()
    ]
    mounts = [
        Mount(kind, robot.mount_link, x - x0, y - y0, z - z0, yaw, 0)
        for kind, (x, y, z, yaw) in placed
    ]
    ray = Sonar(range_max_m=4.5, fov_deg=1.0, rays_per_axis=1)
    return robot.with_sensors(mounts, {"sonar": ray} | {k: other[0] for k, other in others.items()})


def facing(first: Robot, second: Robot, distance: float, yaw: float = 0.0) -> list[PlacedRobot]:
    """The first robot at the origin, and the second one ahead of it, which looks at it."""
    x, y = distance * math.cos(yaw), distance * math.sin(yaw)
    return [PlacedRobot(first, (0, 0, 0, yaw)), PlacedRobot(second, (x, y, 0, yaw + math.pi))]


def read(simulation: Simulation, robots: Sequence[PlacedRobot]) -> Array:
    """The signals of all robots; those of single rays are what they read."""
    signals = np.zeros(sum(robot.signal_count for robot, _ in robots))
    simulation.sense(signals)
    return signals


def observe(simulation: Simulation, count: int) -> Array:
    """The states (count, STATE_SIZE)."""
    states = np.zeros(count * STATE_SIZE)
    simulation.observe(states)
    return states.reshape(count, STATE_SIZE)


def drive(
    simulator: Any,
    robots: Sequence[PlacedRobot],
    world: World,
    commands: Sequence[Sequence[float]],
    steps: int,
) -> tuple[Array, Array]:
    """The states (steps, n, STATE_SIZE) and the signals (steps, n) after each control period."""
    flat = np.array(commands, dtype=float).ravel()
    assert len(flat) == len(robots) * COMMAND_SIZE
    states, signals = [], []
    with simulator.open(robots, world) as simulation:
        for _ in range(steps):
            simulation.advance(flat, STEP)
            states.append(observe(simulation, len(robots)))
            signals.append(read(simulation, robots))
    return np.array(states), np.array(signals)


def first_contacts(states: Array) -> list[int]:
    """The first control period in which each robot has contact; -1 if none."""
    touched = states[:, :, CONTACT] > 0.0
    return [int(rows.argmax()) if rows.any() else -1 for rows in touched.T]
