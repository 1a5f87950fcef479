"""A scenario refuses a simulator that cannot run it."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import pytest

from evoros.base.errors import InputError
from evoros.config.compose import compose
from evoros.simulator.protocol import PlacedRobot, Simulator
from evoros.world.model import World


class Lonely(Simulator):
    """A user's simulator of one robot, without walkers."""

    time_step = 0.02
    packages = ()

    def open(self, robots: Sequence[PlacedRobot], world: World) -> Any:
        raise NotImplementedError


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("experiment=two_rovers", "agents: must be at most 0, not 1, because Lonely"),
        ("walkers=people", "walkers: must be empty with Lonely"),
    ],
)
def test_a_simulator_of_one_robot_alone_is_refused(override: str, message: str) -> None:
    scenario = compose([override, "world=boxes", "executor=serial"]).build().scenario
    with pytest.raises(InputError, match=message):
        replace(scenario, simulator=Lonely())
