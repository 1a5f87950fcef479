"""Movable bodies fall, slide, overlap and stay asleep in all simulators as physics says."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from embedded_cases import random_bodies
from pybullet_cases import beam, box, going_on, level, mount_sensors
from rigid_cases import ENGINES, RIGID, Rigid, probe

from evoros.base.arrays import STATE_SIZE, X
from evoros.evolution.experiment import Experiment
from evoros.geometry.footprint import top_height
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import open_alone
from evoros.simulator.pybullet import PyBullet
from evoros.world.loading import free_bodies
from evoros.world.model import World

pytestmark = pytest.mark.usefixtures("closed_engines")


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> Any:
    return request.param


def crate(name: str, x: float, z: float, mass: float | None = 2.0) -> Body:
    return Body(name, Pose((x, 0.0, z)), (Shape("box", (0.4, 0.4, 0.4)),), mass)


def heights(simulation: object) -> list[float]:
    """The heights of the movable bodies [m]."""
    return [pose.position[2] for pose in probe(simulation).movable()]


@pytest.mark.parametrize("gravity", [9.81, 1.62])
def test_a_body_falls_as_long_as_gravity_says(
    engine: type[Rigid], experiment: Experiment, gravity: float
) -> None:
    """From 2 m: sqrt(2 h / g). PyBullet damps motion by 4 % per second."""
    world = replace(level(experiment, crate("crate", 3.0, 2.2)), gravity_mps2=gravity)
    wanted = math.sqrt(2 * 2.0 / gravity)
    with open_alone(engine(time_step=0.005).open, experiment.robot, world) as simulation:
        assert heights(simulation) == pytest.approx([2.2], abs=1e-6)
        steps = 0
        while heights(simulation)[0] > 0.21 and steps < 1000:
            simulation.advance(np.zeros(2), 0.005)
            steps += 1
        assert steps * 0.005 == pytest.approx(wanted, rel=0.03)
        simulation.advance(np.zeros(2), 2.0)
        # DART raises a body by 1 mm/s out of the ground that it fell into within a step.
        depth = 0.005 if engine is not RIGID.get("gazebo") else math.sqrt(2 * 2.0 * gravity) * 0.005
        assert heights(simulation) == pytest.approx([0.2], abs=depth)


def test_every_mission_begins_before_the_fall(engine: type[Rigid], experiment: Experiment) -> None:
    world, seen = level(experiment, crate("crate", 3.0, 2.2)), []
    for _ in range(3):
        with open_alone(engine().open, experiment.robot, world) as simulation:
            seen += heights(simulation)
            simulation.advance(np.zeros(2), 0.5)
            seen += heights(simulation)
    assert seen[2:] == seen[:2] * 2
    assert seen[1] < seen[0]


def test_what_stands_stays_asleep(experiment: Experiment) -> None:
    """On the ground, on a table and on another body; only the one above nothing falls."""
    bodies = (
        box("table", 3.0, size=(1.0, 1.0, 0.8)),
        crate("on the table", 3.0, 1.0),
        crate("on that", 3.1, 1.4),
        crate("on the ground", -3.0, 0.2),
        crate("leaning", 2.3, 0.5),  # beside the table, whose side it touches
    )
    with open_alone(PyBullet().open, experiment.robot, level(experiment, *bodies)) as simulation:
        movable = list(simulation._model.movable)
        assert [movable.index(body) for body in simulation._model.falling] == [3]
        simulation.advance(np.zeros(2), 1.0)
        lowest = heights(simulation)
    assert lowest[:3] == pytest.approx([1.0, 1.4, 0.2], abs=1e-9)
    assert lowest[3] < 0.21  # it sinks in a little: the step is coarse


def test_bodies_stand_on_parts_of_meshes_and_on_height_fields(experiment: Experiment) -> None:
    """On a slab of corners, on a field, and 0.3 m above the field."""
    corners = tuple((x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (0.0, 0.5))
    slab = Body("slab", Pose((4.0, 0.0, 0.0)), (Shape("convex", (), corners=corners),))
    field = Shape("heightfield", (20.0, 20.0), heights=((0.0,) * 5,) * 5)
    bodies = (
        Body("field", Pose(), (field,)),
        slab,
        crate("on the slab", 4.0, 0.7),
        crate("on the field", -4.0, 0.2),
        crate("above the field", -6.0, 0.5),
    )
    world = replace(level(experiment), bodies=bodies)
    with open_alone(PyBullet().open, experiment.robot, world) as simulation:
        movable = list(simulation._model.movable)
        assert [movable.index(body) for body in simulation._model.falling] == [2]


def test_all_simulators_agree_where_a_body_ends(
    engine: type[Rigid], experiment: Experiment
) -> None:
    """A sensor 0.15 m above the ground sees the crate only once it has fallen."""
    world = level(experiment, crate("crate", 2.2, 1.5))
    robot = mount_sensors(experiment, beam(), (0.2, 0.0, 0.15, 0.0, 0.0))
    readings = np.zeros(1)
    with open_alone(Planar().open, robot, world) as simulation:
        simulation.sense(readings)
        assert readings == pytest.approx([1.8])
    with open_alone(engine().open, robot, world) as physical:
        physical.sense(readings)
        assert readings == pytest.approx([4.5])
        physical.advance(np.zeros(2), 2.0)
        physical.sense(readings)
        assert readings == pytest.approx([1.8], abs=0.01)


GRAVITY = 9.81
TOLERANCE_MPS = GRAVITY * 0.025
"""An engine finds a contact after a step, in which a body that just touches falls freely."""


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


BLOCK, CUBE, SMALL = (0.397, 0.194, 0.143), (0.4, 0.4, 0.4), (0.1, 0.1, 0.1)


def place_of(simulation: Any) -> tuple[float, ...]:
    (pose,) = probe(simulation).movable()
    return tuple(pose.position)


@pytest.mark.parametrize(
    ("mass", "size", "friction"),
    [(0.1, CUBE, 0.3), (5.0, BLOCK, 1.0), (5.0, SMALL, 0.3), (50.0, (1.0, 1.0, 1.0), 0.3)],
)
def test_a_dragged_body_stays_on_the_ground(
    engine: type[Rigid],
    experiment: Experiment,
    mass: float,
    size: tuple[float, float, float],
    friction: float,
) -> None:
    """Thrown at 2 m/s it slides by v^2 / (2 mu g). PyBullet damps motion by 4 % per second."""
    body = replace(box("body", 5.0, size=size, mass=mass), friction=friction)
    robot = experiment.robot.with_sensors([], {})
    with open_alone(engine().open, robot, going_on(level(experiment, body))) as simulation:
        start, heights = place_of(simulation), []
        probe(simulation).throw(2.0)
        for _ in range(40):
            simulation.advance(np.zeros(2), 0.05)
            heights.append(place_of(simulation)[2])
        end = place_of(simulation)
    assert max(abs(height - start[2]) for height in heights) < 2e-3
    assert end[0] - start[0] == pytest.approx(4.0 / (2 * friction * 9.81), rel=0.06)


BARREL = Body("barrel", Pose((0.6, 0.0, 0.2)), (Shape("cylinder", (0.15, 0.4)),), 2.0, 0.3)


@pytest.mark.parametrize(
    ("body", "half_m"),
    [
        (replace(box("block", 0.6, size=BLOCK, mass=5.0), friction=0.3), BLOCK[0] / 2),
        (replace(box("small", 0.6, size=SMALL, mass=0.1), friction=1.0), SMALL[0] / 2),
        (BARREL, 0.15),
    ],
)
def test_a_pushed_body_stays_on_the_ground_and_ahead_of_the_rover(
    engine: type[Rigid], experiment: Experiment, body: Body, half_m: float
) -> None:
    """It goes as fast as the rover, whose front is 0.25 m ahead. A second mission is the same.

    MuJoCo lifts what slides, here by 1.2 mm.
    """
    robot, world = experiment.robot.with_sensors([], {}), going_on(level(experiment, body))
    seen = []
    for _ in range(2):
        with open_alone(engine().open, robot, world) as simulation:
            start, state = place_of(simulation), np.zeros(STATE_SIZE)
            places = []
            for _ in range(30):
                simulation.advance(np.array([0.3, 0.0]), 0.1)
                places.append(place_of(simulation))
            simulation.observe(state)
            seen.append([*places[-1], *state])
    assert max(abs(place[2] - start[2]) for place in places) < 1.5e-3
    assert places[-1][0] - places[15][0] == pytest.approx(1.4 * 0.3, rel=0.04)
    assert places[-1][0] - state[X] == pytest.approx(0.25 + half_m, abs=5e-3)
    assert seen[0] == seen[1]


@pytest.mark.slow
def test_steps_stay_long_where_nothing_is_pushed(experiment: Experiment) -> None:
    """In missions that end at the first contact, and far from bodies."""
    near, far = box("box", 1.0, size=CUBE, mass=1.0), box("box", 5.0, size=CUBE, mass=1.0)
    robot = experiment.robot.with_sensors([], {})
    worlds = (level(experiment, near), going_on(level(experiment, far)))
    for world in worlds:
        with open_alone(PyBullet().open, robot, world) as simulation:
            for _ in range(20):
                simulation.advance(np.array([0.3, 0.0]), 0.1)
                assert simulation._substeps == 1
