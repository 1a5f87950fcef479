"""How far PyBullet deviates with coarse steps, few solver iterations and two shapes of wheels."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import openloop
from openloop import commands

from evoros.base.arrays import SPEED, Array, X, Y
from evoros.robot.model import Robot
from evoros.simulator.protocol import Simulator, open_alone
from evoros.simulator.pybullet import PyBullet
from evoros.world.model import World

STEPS = (0.0025, 0.005, 0.01, 0.02, 0.025, 0.05)  # [s]
ITERATIONS = (50, 20, 10, 4)
WHEELS = ("sphere", "cylinder")
SPEED_MPS, SECONDS = 0.29, 20.0
TOLERANCE = 2.0  # [%]
MANOEUVRES: dict[str, Callable[[float], float]] = {
    "straight": lambda time: 0.0,
    "turn": lambda time: 0.3,
    "weave": lambda time: 0.3 * math.sin(2.0 * math.pi * time / 9.7),
}


def drive(simulator: Simulator, robot: Robot, world: World, name: str) -> Array:
    """Drive a manoeuvre; returns x, y [m] and speed [m/s] every 0.1 s, (n, 3)."""
    wanted = commands(lambda time: (SPEED_MPS, MANOEUVRES[name](time)), SECONDS)
    track = openloop.drive(simulator, robot, world, wanted, world.course.home[3])
    return track[1:, [X, Y, SPEED]]


def deviation(track: Array, reference: Array) -> float:
    """The maximum distance from the reference at the same time, in % of its length."""
    length = np.linalg.norm(np.diff(reference[:, :2], axis=0), axis=1).sum()
    gaps = np.linalg.norm(track[:, :2] - reference[:, :2], axis=1)
    return float(100.0 * gaps.max() / length)


def radius(track: Array) -> float:
    """The radius [m] of the circle that best fits the second half of a track (Kasa's method)."""
    x, y = track[len(track) // 2 :, :2].T
    terms = np.stack([x, y, np.ones_like(x)], axis=1)
    (a, b, c), *_ = np.linalg.lstsq(terms, x * x + y * y, rcond=None)
    return math.sqrt(float(c + a * a / 4 + b * b / 4))


@dataclass(frozen=True)
class Row:
    """One combination: its deviations [%], the radius [m] of the turn, the straight speed [m/s]."""

    wheels: str
    step: float
    iterations: int
    deviations: tuple[float, ...]
    radius: float
    speed: float


def deviations(robots: dict[str, Robot], world: World) -> list[Row]:
    """Compare all combinations with the finest one that has the same wheels."""
    rows = []
    for wheels, robot in robots.items():
        finest = {name: drive(PyBullet(0.0025, 50), robot, world, name) for name in MANOEUVRES}
        for step in STEPS:
            for iterations in ITERATIONS:
                simulator = coarse(step, iterations)
                tracks = {name: drive(simulator, robot, world, name) for name in MANOEUVRES}
                measured = tuple(deviation(tracks[name], finest[name]) for name in MANOEUVRES)
                speed = float(tracks["straight"][-100:, 2].mean())
                rows.append(Row(wheels, step, iterations, measured, radius(tracks["turn"]), speed))
    return rows


def coarse(step: float, iterations: int) -> PyBullet:
    """A simulator with any step, also with one that it refuses, to show why."""
    simulator = PyBullet(solver_iterations=iterations)
    object.__setattr__(simulator, "time_step", step)
    return simulator


def pushed(simulator: PyBullet, robot: Robot, world: World) -> tuple[float, float]:
    """How far [mm] the rover pushes a 5 kg block in 8 s, and how far it sinks meanwhile."""
    with open_alone(simulator.open, robot, world) as opened:
        simulation: Any = opened
        bullet = simulation._bullet
        (block, (before, _)) = next(iter(simulation._model.movable.items()))
        simulation.advance(np.array([0.3, 0.0]), 8.0)
        after, _ = bullet.getBasePositionAndOrientation(block)
    return 1e3 * math.dist(after[:2], before[:2]), 1e3 * (before[2] - after[2])
