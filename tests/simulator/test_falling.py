"""Movable bodies in the air fall in all simulators; those that stand stay asleep."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pybullet_cases import beam, box, level, mount_sensors
from rigid_cases import ENGINES, Rigid, probe

from evoros.evolution.experiment import Experiment
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.plugins.gazebo.simulator import Gazebo
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import open_alone
from evoros.simulator.pybullet import PyBullet

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
        depth = 0.005 if engine is not Gazebo else math.sqrt(2 * 2.0 * gravity) * 0.005
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
