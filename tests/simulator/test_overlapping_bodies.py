"""No engine throws movable bodies that start in the ground or in each other."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from embedded_cases import random_bodies
from pybullet_cases import level
from rigid_cases import ENGINES, Rigid, probe

from evoros.base.arrays import STATE_SIZE
from evoros.evolution.experiment import Experiment
from evoros.geometry.footprint import top_height
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import open_alone
from evoros.world.loading import free_bodies
from evoros.world.model import World

pytestmark = pytest.mark.usefixtures("closed_engines")

GRAVITY = 9.81
TOLERANCE_MPS = GRAVITY * 0.025
"""An engine finds a contact after a step, in which a body that just touches falls freely."""


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> Any:
    return request.param


def load(experiment: Experiment, *bodies: Body) -> World:
    """Open ground with these bodies, as a file with them is loaded."""
    world = level(experiment, *bodies)
    course = replace(world.course, end_on_collision=False)  # so that PyBullet takes fine steps
    return replace(world, bodies=free_bodies(world.bodies, "a.sdf"), course=course)


def top_speed(
    engine: type[Rigid], experiment: Experiment, world: World, step: float = 0.025
) -> float:
    """The highest speed [m/s] of a movable body within a second, all of which are awake."""
    highest = 0.0
    with open_alone(engine(time_step=step).open, experiment.robot, world) as simulation:
        probe(simulation).wake()
        for _ in range(round(1.0 / step)):
            simulation.advance(np.zeros(2), step)
            highest = max([highest, *probe(simulation).speeds()])
    return highest


@pytest.mark.parametrize(
    ("seed", "step"),
    [*((seed, 0.025) for seed in range(6)), *((seed, 0.0025) for seed in range(2))],
)
def test_bodies_that_overlap_are_not_faster_than_in_a_free_fall(
    engine: type[Rigid], experiment: Experiment, seed: int, step: float
) -> None:
    """From their highest point to the ground: they may fall from each other, or topple."""
    bodies = random_bodies(seed)
    world = load(experiment, *bodies)
    tops = [top_height(s, b.pose @ s.pose) for b in world.obstacles if b.mass for s in b.shapes]
    limit = math.sqrt(2 * GRAVITY * max(tops, default=0.0))
    assert top_speed(engine, experiment, world, step) <= limit + TOLERANCE_MPS


@pytest.mark.parametrize("depth", [0.0005, 0.002, 0.01, 0.1, 0.5, 0.9])
@pytest.mark.parametrize("shape", ["cylinder", "box", "sphere"])
def test_what_starts_in_the_ground_stays_at_rest(
    engine: type[Rigid], experiment: Experiment, shape: str, depth: float
) -> None:
    """So do bodies 0.5 mm and 2 mm deep, which the engine itself sets on the ground."""
    shapes = {
        "cylinder": Shape("cylinder", (0.075, 1.0)),
        "box": Shape("box", (0.3, 0.3, 1.0)),
        "sphere": Shape("sphere", (0.5,)),
    }
    bodies = [
        Body(f"{i}", Pose((3.0 + i, 0.0, 0.5 - depth)), (shapes[shape],), 1.0) for i in range(3)
    ]
    assert top_speed(engine, experiment, load(experiment, *bodies)) <= 1.01 * TOLERANCE_MPS


def test_all_simulators_see_the_same_world(engine: type[Rigid], experiment: Experiment) -> None:
    """Bodies that overlap are one obstacle in the plane as well, and can be pushed as one."""
    pair = [Body(n, Pose((x, 0.0, 0.1)), (Shape("box", (0.4, 0.4, 0.4)),), 0.5)
            for n, x in (("a", 1.0), ("b", 1.3))]  # fmt: skip
    world = load(experiment, *pair)
    (body,) = world.obstacles
    robot, command = experiment.robot, np.array([0.3, 0.0])
    with open_alone(engine().open, robot, world) as rigid:
        rigid.advance(command, 4.0)
        (pose,) = probe(rigid).movable()
    state = np.zeros(STATE_SIZE)
    with open_alone(Planar().open, robot, world) as planar:
        planar.advance(command, 4.0)
        planar.observe(state)
    assert pose.position[0] > body.pose.position[0] + 0.2
    assert state[0] == pytest.approx(4.0 * 0.3, abs=0.15)
