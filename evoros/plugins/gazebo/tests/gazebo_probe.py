"""Gazebo's answers to the questions that tests ask of all rigid-body engines."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from evoros.base.arrays import Array
from evoros.geometry.shapes import Pose, normalize
from evoros.plugins.gazebo.server import Operation
from evoros.plugins.gazebo.simulator import GazeboSimulation


class GazeboProbe:
    """A ``Probe`` of tests/rigid_cases.py."""

    def __init__(self, simulation: GazeboSimulation) -> None:
        self.simulation = simulation

    def base(self) -> Pose:
        return self._pose(self.simulation.values[:7].tolist())

    def _pose(self, values: Sequence[float]) -> Pose:
        x, y, z, qw, qx, qy, qz = values
        return Pose((x, y, z), normalize((qx, qy, qz, qw)))

    def movable(self) -> list[Pose]:
        return [self._pose(row) for row in self.simulation.bodies.tolist()]

    def _ask(self, *added: float) -> Array:
        server, number = self.simulation._server, self.simulation._number
        body = np.array(added).tobytes()
        return server.ask(Operation.PROBE, number, body).reshape(-1, 3)

    def push(self, force: float) -> None:
        """By the change of speed in a step: the body is of 5 kg."""
        self._ask(force / 5.0 * self.simulation._time_step, 0.0, 0.0)

    def throw(self, speed: float) -> None:
        self._ask(speed, 0.0, 0.0)

    def wake(self) -> None:
        """The engine computes all bodies in every step."""

    def speeds(self) -> list[float]:
        return [math.hypot(*row) for row in self._ask(0.0, 0.0, 0.0).tolist()]

    def moments(self) -> list[float]:
        pytest.skip("the library tells no moments of inertia; SDF has those of the body")

    def angle(self, joint: str) -> float:
        (vehicle,) = self.simulation._vehicles
        drive, angles = vehicle._drive, self.simulation.values[vehicle.angles]
        driven = [*drive.wheel_joints, *drive.steering_joints]
        if joint not in driven:
            pytest.skip("the server tells only the angles of joints that it drives")
        return float(angles[driven.index(joint)])

    def height(self, x: float, y: float) -> float:
        pytest.skip("the library casts no rays; MuJoCo's do")
