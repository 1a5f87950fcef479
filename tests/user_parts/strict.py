"""The planar simulator with another step, in which robots with sensors far ahead do not drive."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from planar import Planar

from evoros.base.errors import SimulationError
from evoros.simulator.protocol import PlacedRobot
from evoros.world.model import World


@dataclass(frozen=True)
class Strict(Planar):
    most_x_m: float = 0.1  # mean x of the sensors

    @contextmanager
    def open(self, robots: Sequence[PlacedRobot], world: World) -> Iterator[Any]:
        ((robot, _),) = robots
        if robot.sensor_poses[:, 0].mean() > self.most_x_m:
            raise SimulationError("heavy at the front")
        with super().open(robots, world) as simulation:
            yield simulation
