"""Experiments, worlds and robots for the tests of the PyBullet simulator."""

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from evoros.base.arrays import Array
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.mission.mission import Mission
from evoros.mission.rollout import run_mission
from evoros.robot.model import Robot
from evoros.sensor.protocol import Mount, Sensor
from evoros.sensor.sonar import Sonar
from evoros.simulator.protocol import open_alone
from evoros.simulator.pybullet import MAX_STEP_S, PyBullet
from evoros.world.model import World

STEPS = (0.0025, 0.005, 0.01, 0.02, MAX_STEP_S)
LIMITS = [f"world.{name}.course.time_limit_s=8" for name in ("boxes", "maze", "blocks")]


def short_experiment() -> Experiment:
    return compose(["failure=random", "simulator=pybullet", *LIMITS]).build()


def mission(experiment: Experiment, world: str, design_id: int = 0, trial: int = 0) -> Mission:
    rng = np.random.default_rng(design_id)
    design = experiment.space.decode(rng.random(experiment.space.size))
    return Mission(0, design_id, design, world, trial, "evaluation", f"test:{design_id}:{trial}")


def digest_of_missions(experiment: Experiment) -> str:
    """A digest of every bit of some missions."""
    digest = hashlib.sha256()
    for world in experiment.world:
        (outcome,), track = run_mission(experiment.scenario, mission(experiment, world))
        digest.update(track.tobytes() + repr(outcome).encode())
    return digest.hexdigest()


def level(experiment: Experiment, *bodies: Body) -> World:
    """Open ground with these bodies."""
    world = experiment.world["boxes"]
    ground = tuple(body for body in world.bodies if body.is_ground)
    course = replace(world.course, home_yaw_rad=0.0, home_z_m=0.0)
    return replace(world, bodies=(*ground, *bodies), course=course)


def box(
    name: str,
    x: float,
    y: float = 0.0,
    size: Sequence[float] = (1.0, 1.0, 1.0),
    mass: float | None = None,
) -> Body:
    edges = (float(size[0]), float(size[1]), float(size[2]))
    return Body(name, Pose((x, y, edges[2] / 2)), (Shape("box", edges),), mass=mass)


def beam(range_max_m: float = 4.5, **values: Any) -> Sonar:
    """A sensor of a single ray."""
    return Sonar(range_max_m=range_max_m, fov_deg=1.0, rays_per_axis=1, **values)


def mount_sensors(
    experiment: Experiment, sensor: Sensor, *poses: tuple[float, float, float, float, float]
) -> Robot:
    """Sensors at x, y, z [m], yaw, pitch [deg] of the base link."""
    mounts = [Mount("sonar", "base_link", *pose) for pose in poses]
    return experiment.robot.with_sensors(mounts, {"sonar": sensor})


def ranges(robot: Robot, world: World, settle: float = 0.0) -> Array:
    readings = np.zeros(len(robot.mounts))
    with open_alone(PyBullet().open, robot, world) as simulation:
        if settle:
            simulation.advance(np.zeros(2), settle)
        simulation.sense(readings)
    return readings


def going_on(world: World) -> World:
    """The same world, in which missions go on after contact."""
    return replace(world, course=replace(world.course, end_on_collision=False))
