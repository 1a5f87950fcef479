"""Measures a control tick of the planar simulator against sensors, rays and obstacles.

A tick is one sensing and five steps of 20 ms with their contact tests, compiled. The robot walks
through a field with the density of the case study's boxes. ``performance.py`` uses this module;
alone it prints its table:

    python benchmarks/performance/tick_cost.py
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np
from numba import njit

from evoros.base.packing import unpack
from evoros.compilation.rules import SIMULATION_RULES, compile_rule
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.robot.model import Robot
from evoros.sensor.protocol import Mount
from evoros.sensor.sonar import Sonar
from evoros.simulator.engines.planar_layout import Memory
from evoros.simulator.protocol import RuleSimulation, open_alone
from evoros.world.model import World

DENSITY = 0.19  # obstacles per square metre, as of nineteen boxes on ten by ten metres
TICK_S, TICKS, REPEATS = 0.1, 100_000, 5
SENSORS = (1, 3, 6, 12, 24, 48)
RAYS_PER_AXIS = (1, 3, 5, 7, 10, 15)
OBSTACLES = (20, 200, 2_000, 20_000)

Point = tuple[int, float]  # number, microseconds per tick


@njit
def run_walk(sense, advance, parameters, memory, motion, walk, readings, command):  # type: ignore[no-untyped-def]
    """Sense and advance from each pose of a walk (n, 3); ``motion`` is a view of the memory."""
    for k in range(len(walk)):
        motion[:3] = walk[k]
        sense(parameters, memory, readings)
        advance(parameters, memory, command, TICK_S)


def rover(experiment: Experiment, sensors: int, rays_per_axis: int) -> Robot:
    """The rover with sensors in all directions."""
    sonar = Sonar(rays_per_axis=rays_per_axis)
    around = [360.0 * i / sensors for i in range(sensors)]
    mounts = [Mount("sonar", "base_link", 0.1, 0.0, 0.166, yaw, 12.5) for yaw in around]
    return experiment.robot.with_sensors(mounts, {"sonar": sonar})


def field(experiment: Experiment, obstacles: int) -> World:
    """A square with boxes at random places; home is outside of it."""
    rng, side = np.random.default_rng(1), math.sqrt(obstacles / DENSITY)
    half = side / 2
    poses = rng.uniform((-half, -half, 0.0), (half, half, math.tau), (obstacles, 3))
    boxes = [
        Body(f"box_{i}", Pose.from_rpy((x, y, 0.2), 0.0, 0.0, yaw), (Shape("box", (0.4,) * 3),))
        for i, (x, y, yaw) in enumerate(poses.tolist())
    ]
    world = experiment.world["boxes"]
    ground = [body for body in world.bodies if body.is_ground]
    course = replace(world.course, home_x_m=2.0 * side, waypoints=((2.0 * side, side),))
    return World("field", (*ground, *boxes), course, "field", f"{obstacles}")


def walk(obstacles: int) -> "np.ndarray[tuple[int, int], np.dtype[np.float64]]":
    """Poses (TICKS, 3) inside the field, each 3 cm from the one before."""
    rng, side = np.random.default_rng(2), math.sqrt(obstacles / DENSITY) - 2.0
    yaw = np.cumsum(rng.normal(0.0, 0.2, TICKS))
    steps = 0.03 * np.column_stack([np.cos(yaw), np.sin(yaw)])
    inside = (np.cumsum(steps, axis=0) + side / 2) % side - side / 2
    return np.column_stack([inside, yaw])


def cost(experiment: Experiment, robot: Robot, obstacles: int) -> float:
    """The time [us] of a tick: the minimum of some repeats, as other programs only add to it."""
    world, poses = field(experiment, obstacles), walk(obstacles)
    with open_alone(experiment.simulator.open, robot, world) as simulation:
        assert isinstance(simulation, RuleSimulation)
        _, sense, advance = map(compile_rule, simulation.rules, SIMULATION_RULES)
        readings, command = np.zeros(len(robot.mounts)), np.array([0.3, 0.2])
        motion = unpack(Memory, simulation.memory).motions[0]
        arguments = (sense, advance, simulation.parameters, simulation.memory, motion)
        run_walk(*arguments, poses[:10], readings, command)
        times = []
        for _ in range(REPEATS):
            begin = perf_counter()
            run_walk(*arguments, poses, readings, command)
            times.append(perf_counter() - begin)
    return 1e6 * min(times) / TICKS


def curves() -> dict[str, list[Point]]:
    """The cost of a tick for each varied number; all else is as in the case study."""
    experiment = compose(["simulator=planar"]).build()
    six = rover(experiment, 6, 5)
    return {
        "sensors": [(n, cost(experiment, rover(experiment, n, 5), 200)) for n in SENSORS],
        "rays of a sensor": [
            (n * n, cost(experiment, rover(experiment, 6, n), 200)) for n in RAYS_PER_AXIS
        ],
        "obstacles": [(n, cost(experiment, six, n)) for n in OBSTACLES],
    }


def table(curves: dict[str, Sequence[Point]]) -> str:
    """The curves as a table in Markdown."""
    lines = ["| varied | number | us a tick |", "|---|---|---|"]
    for name, points in curves.items():
        counts = "; ".join(f"{count:,}" for count, _ in points)
        values = "; ".join(f"{value:.2f}" for _, value in points)
        lines.append(f"| {name} | {counts} | {values} |")
    return "\n".join(lines)


if __name__ == "__main__":
    print(table(curves()))  # type: ignore[arg-type]
