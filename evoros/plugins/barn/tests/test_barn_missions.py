"""Missions in BARN worlds: one way, with the length of the shortest way in the outcome."""

from dataclasses import replace

import numpy as np
import pytest

from evoros import compose
from evoros.design.design import Design
from evoros.mission.mission import COMPLETED, Mission
from evoros.mission.rollout import run_mission
from evoros.plugins.barn.fitness import score_mission


@pytest.mark.slow
def test_a_hand_made_robot_arrives_and_scores() -> None:
    experiment = compose(["experiment=barn_gap"]).build()
    design: Design = experiment.space.decode(np.full(experiment.space.size, 0.5))
    mission = Mission(0, 0, design, "barn", 0, "selection", "easy/0")
    (outcome,), trajectory = run_mission(experiment.scenario, mission)
    world = experiment.world["barn"].at("easy/0")
    assert outcome.shortest_m == world.shortest_m is not None
    assert outcome.ended == COMPLETED
    assert outcome.visited == 1
    assert outcome.least_waypoint_distances_m[0] <= 1.0  # it ends there, without a way back
    assert 0.125 <= score_mission(outcome) <= 0.5
    late = replace(experiment.world["barn"].course, time_limit_s=2.0)
    assert late.route(True).shape == (1, 2)
    assert len(trajectory) > 10
