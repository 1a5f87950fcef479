"""Worlds of thousands of bodies work in every simulator, or are refused before a mission."""

from dataclasses import replace

import numpy as np
import pytest
from proposal_sites import is_of
from pybullet_cases import mission, short_experiment

from evoros.base.errors import InputError
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.mission.mission import NOT_RUN
from evoros.mission.rollout import run_mission
from evoros.mission.scenario import Scenario
from evoros.simulator.mujoco import MOST_MOVABLE, Mujoco
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import Simulator
from evoros.simulator.pybullet import PyBullet

ROW = 150


def posts(count: int, mass: float | None) -> tuple[Body, ...]:
    """Boxes in rows, all of them far away from the course."""
    return tuple(
        Body(
            f"post{i}",
            Pose((20.0 + 0.8 * (i // ROW), 0.8 * (i % ROW), 0.25)),
            (Shape("box", (0.3, 0.3, 0.5)),),
            mass=mass,
        )
        for i in range(count)
    )


def crowd(simulator: Simulator, count: int, mass: float | None = None) -> Scenario:
    experiment = short_experiment()
    name = next(iter(experiment.world))
    world = experiment.world[name]
    crowded = replace(world, bodies=(*world.bodies, *posts(count, mass)), source_sha256="crowd")
    return replace(experiment.scenario, simulator=simulator, world={name: crowded})


@pytest.mark.slow
@pytest.mark.parametrize("simulator", [Planar(), Mujoco(), PyBullet()])
def test_a_thousand_obstacles_far_away_change_nothing(simulator: Simulator) -> None:
    alone, crowded = crowd(simulator, 0), crowd(simulator, 1_000)
    wanted = mission(short_experiment(), next(iter(alone.world)))
    (outcome,), track = run_mission(crowded, wanted)
    (expected,), reference = run_mission(alone, wanted)
    assert outcome.ended == expected.ended
    assert outcome.ended not in NOT_RUN
    # Engines of rigid bodies sum over contacts in another order.
    np.testing.assert_allclose(track, reference, atol=1e-6)


@pytest.mark.slow
def test_mujoco_simulates_a_thousand_movable_bodies() -> None:
    scenario = crowd(Mujoco(), 1000, 1.0)
    (outcome,), track = run_mission(
        scenario, mission(short_experiment(), next(iter(scenario.world)))
    )
    assert outcome.ended not in NOT_RUN, outcome.reason
    assert len(track) > 1


@pytest.mark.slow
def test_mujoco_refuses_more_before_a_mission() -> None:
    with pytest.raises(InputError, match=f"at most {MOST_MOVABLE} movable bodies") as refused:
        crowd(Mujoco(), MOST_MOVABLE + 1, 1.0)
    assert is_of(str(refused.value), "evoros/simulator/mujoco.py simulator=mujoco")
    crowd(PyBullet(), MOST_MOVABLE + 1, 1.0)
