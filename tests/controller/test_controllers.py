"""Every bundled controller that is made of rules keeps what all controllers keep."""

import math
from dataclasses import fields
from functools import cache, cached_property
from typing import Any

import numpy as np
import pytest

from evoros.config.compose import compose
from evoros.controller.blind import Blind
from evoros.controller.dead_reckoning import DeadReckoning
from evoros.controller.follow_the_gap import FollowTheGap
from evoros.controller.l1 import L1
from evoros.controller.serpentine import Serpentine
from evoros.controller.weighted_voting import WeightedVoting
from evoros.robot.model import Robot
from evoros.testing import ControllerSuite, EstimatorSuite, LayerSuite


@cache
def member_of(override: str) -> Any:
    """The robot of a configuration with a design, and its controller."""
    experiment = compose(["simulator=planar", override]).build()
    genes = np.full(experiment.space.size, 0.6)
    return experiment.members[0].with_design(experiment.space.decode(genes))


class TestControllers(ControllerSuite):
    @pytest.fixture(
        autouse=True,
        params=[
            *(f"controller={name}" for name in ("rover", "rover_l1", "indoor", "neural")),
            "controller/avoidance=blind",
        ],
    )
    def choose(self, request: pytest.FixtureRequest) -> None:
        member = member_of(request.param)
        self.part, self.robot = member.controller, member.robot


class TestLayers(LayerSuite):
    @pytest.fixture(autouse=True, params=[Blind, FollowTheGap, L1, Serpentine, WeightedVoting])
    def choose(self, request: pytest.FixtureRequest) -> None:
        self.part = request.param()
        self.bad_values = [
            {field.name: value}
            for field in fields(request.param)
            for value in (-1.0, math.nan, math.inf, "fast", None, True)
        ]


class TestDeadReckoning(EstimatorSuite):
    part = DeadReckoning()

    @cached_property
    def robot(self) -> Robot:
        robot: Robot = member_of("experiment=reckoning").robot
        return robot
