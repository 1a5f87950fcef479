"""Gazebo keeps what all simulators keep."""

from functools import cached_property

import pytest

from evoros.plugins.gazebo.simulator import Gazebo
from evoros.testing import SimulatorSuite


@pytest.mark.gz_physics
@pytest.mark.usefixtures("closed_engines")
class TestGazebo(SimulatorSuite):
    bad_values = (
        {"wheel_friction": 0.0},
        {"steering_lag_s": -1.0},
        {"answer_limit_s": 0.0},
        {"time_step": 0.1},
    )

    @cached_property
    def part(self) -> Gazebo:  # type: ignore[override]
        return Gazebo()
