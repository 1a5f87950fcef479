"""Bodies that slide in either engine at its default step stay on the ground."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pybullet_cases import box, going_on, level, short_experiment
from rigid_cases import ENGINES, Rigid, probe

from evoros.base.arrays import STATE_SIZE, X
from evoros.evolution.experiment import Experiment
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.simulator.protocol import open_alone
from evoros.simulator.pybullet import PyBullet

pytestmark = pytest.mark.usefixtures("closed_engines")

BLOCK, CUBE, SMALL = (0.397, 0.194, 0.143), (0.4, 0.4, 0.4), (0.1, 0.1, 0.1)


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return short_experiment()


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> Any:
    return request.param


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
