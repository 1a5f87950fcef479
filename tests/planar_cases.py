"""Worlds, robots and started simulations for the tests of the planar simulator."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from evoros.base.arrays import STATE_SIZE, Array
from evoros.base.packing import unpack
from evoros.config.compose import compose
from evoros.evolution.experiment import Experiment
from evoros.geometry.footprint import Footprint, project_bodies
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.robot.model import Robot
from evoros.robot.outline import Occluders
from evoros.sensor.protocol import Mount
from evoros.sensor.sonar import Sonar
from evoros.simulator.engines.planar_layout import Memory, place_robot
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import RuleSimulation, Simulation, open_alone
from evoros.world.model import World

calm = settings(max_examples=25)
speeds = st.floats(-0.39, 0.39)
steerings = st.floats(-0.6, 0.6)
coordinates = st.floats(-6.0, 6.0)
angles = st.floats(-math.pi, math.pi)
lengths = st.floats(0.05, 2.0)


def rock(seed: int) -> Shape:
    """A convex polyhedron of up to 12 corners, away from the origin of its frame."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1.0, 1.0, 3) + rng.uniform(-0.8, 0.8, (rng.integers(5, 13), 3))
    return Shape("convex", (), corners=tuple((x, y, z) for x, y, z in corners.tolist()))


shapes = st.one_of(
    st.builds(lambda x, y, z: Shape("box", (x, y, z)), lengths, lengths, lengths),
    st.builds(lambda r, h: Shape("cylinder", (r, h)), lengths, lengths),
    st.builds(lambda r: Shape("sphere", (r,)), lengths),
    st.builds(lambda seed: rock(seed), st.integers(0, 2**32)),
)
solids = st.builds(
    lambda shape, x, y, z, roll, pitch, yaw: (shape, Pose.from_rpy((x, y, z), roll, pitch, yaw)),
    shapes,
    coordinates,
    coordinates,
    st.floats(0.0, 2.0),
    angles,
    angles,
    angles,
)


@cache
def experiment() -> Experiment:
    return compose(["simulator=planar"]).build()


def world_of(*placed: tuple[Shape, Pose]) -> World:
    """Level ground with these bodies; home far away, for some of them may lie anywhere."""
    world = experiment().world["boxes"]
    ground = [body for body in world.bodies if body.is_ground]
    bodies = [Body(f"body_{i}", pose, (shape,)) for i, (shape, pose) in enumerate(placed)]
    course = replace(world.course, home_x_m=90.0, home_yaw_rad=0.0, waypoints=((99.0, 99.0),))
    return replace(world, bodies=(*ground, *bodies), course=course)


def rover(*poses: tuple[float, float, float, float, float], **sonar: float) -> Robot:
    """The rover with sonars at x, y, z [m], yaw, pitch [deg], which do not see it."""
    mounts = [Mount("sonar", "base_link", *pose) for pose in poses]
    robot = replace(experiment().robot, occluders=Occluders())
    return robot.with_sensors(mounts, {"sonar": Sonar(**sonar)})  # type: ignore[arg-type]


def start(
    world: World,
    robot: Robot | None = None,
    pose: Sequence[float] = (0.0, 0.0, 0.0),
    simulator: Planar | None = None,
) -> RuleSimulation:
    simulator = simulator or Planar(steering_lag_s=0.0, drive_lag_s=0.0)
    with open_alone(simulator.open, robot or rover(), world) as simulation:
        put(simulation, *pose)
        return simulation


def put(simulation: RuleSimulation, x: float, y: float, yaw: float) -> None:
    """Put the robot of a simulation at a pose."""
    place_robot(unpack(Memory, simulation.memory), 0, x, y, yaw)


def state_of(simulation: Simulation) -> Array:
    state = np.zeros(STATE_SIZE)
    simulation.observe(state)
    return state


def project_obstacles(world: World, robot: Robot) -> tuple[Footprint, ...]:
    return project_bodies(world.obstacles, robot.height_m)
