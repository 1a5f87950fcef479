"""Every simulator keeps what all simulators keep."""

from functools import cached_property

import pytest

from evoros.simulator.mujoco import Mujoco
from evoros.simulator.planar import Planar
from evoros.simulator.pybullet import PyBullet
from evoros.testing import SimulatorSuite
from evoros.testing.subjects import example_world
from evoros.world.model import World


class TestPlanar(SimulatorSuite):
    part = Planar()


class TestMujoco(SimulatorSuite):
    part = Mujoco()
    bad_values = ({"wheel_friction": 0.0}, {"steering_lag_s": -1.0})


class TestMujocoWithMovableBodies(SimulatorSuite):
    part = Mujoco()

    @cached_property
    def world(self) -> World:
        return example_world("blocks")


@pytest.mark.usefixtures("closed_engines")
class TestPyBullet(SimulatorSuite):
    part = PyBullet()
