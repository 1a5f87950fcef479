"""A user's own simulator: a bicycle on an empty plane, with a wall of noise for sensors.

Faults are injected for real: the ``fault`` happens in the worker process, in the named mission.
"""

import math
import os
import signal
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import CONTACT, SPEED, STEERING, YAW, YAW_RATE, Array, X, Y
from evoros.base.checks import POSITIVE, TEXT, checked, invalid
from evoros.base.errors import SimulationError
from evoros.filter.protocol import Channels, Filter
from evoros.robot.model import Robot
from evoros.simulator.protocol import PlacedRobot, Simulator
from evoros.world.model import World


@dataclass(frozen=True)
@checked
class Planar(Simulator):
    """``fault``: none, raise, exit, hang or fail, in ``fault_limit_s``; with ``mark``, once.

    Missions do not pause once the file ``mark`` exists.
    """

    time_step: Annotated[float, POSITIVE] = 0.05
    pause_s: float = 0.0  # wall clock, for each mission
    fault: Annotated[str, TEXT] = "none"
    fault_limit_s: float = 30.0  # time limit of the world in which it happens
    mark: str = ""
    packages = ()

    @contextmanager
    def open(self, robots: Sequence[PlacedRobot], world: World) -> Iterator["Plane"]:
        if not (self.mark and Path(self.mark).exists()):
            time.sleep(self.pause_s)
        if world.course.time_limit_s == self.fault_limit_s and self._is_due():
            self._happen()
        ((robot, _),) = robots
        yield Plane(robot, world, self.time_step)

    def _is_due(self) -> bool:
        if not self.mark:
            return True
        try:
            Path(self.mark).touch(exist_ok=False)
        except FileExistsError:
            return False
        return True

    def _happen(self) -> None:
        if self.fault == "raise":
            raise ZeroDivisionError("the planar\nfault")
        if self.fault == "fail":
            raise SimulationError("the planar engine gave up, said “no”")
        if self.fault == "exit":
            os.kill(os.getpid(), signal.SIGKILL)
        if self.fault == "hang":
            time.sleep(3600)


class Plane:
    """The mutable state: x, y, yaw, speed."""

    def __init__(self, robot: Robot, world: World, step: float) -> None:
        self.wheelbase, self.step = robot.drive.wheelbase_m, step
        self.yaws = robot.sensor_poses[:, 3]
        home = world.course.home
        self.x, self.y, self.yaw, self.speed, self.rate = home[0], home[1], home[3], 0.0, 0.0

    def observe(self, state: Array) -> None:
        state[X], state[Y], state[YAW] = self.x, self.y, self.yaw
        state[SPEED], state[YAW_RATE], state[CONTACT] = self.speed, self.rate, 0.0

    def sense(self, readings: Array) -> None:
        readings[:] = np.clip(3.0 + self.x * np.cos(self.yaw + self.yaws), 0.06, 4.5)

    def advance(self, command: Array, duration: float) -> None:
        for _ in range(round(duration / self.step)):
            self.speed = float(command[0])
            self.rate = self.speed / self.wheelbase * math.tan(float(command[STEERING]))
            self.yaw += self.rate * self.step
            self.x += self.speed * self.step * math.cos(self.yaw)
            self.y += self.speed * self.step * math.sin(self.yaw)


@dataclass(frozen=True)
class Picky(Filter):
    """A filter that does nothing and refuses values in the middle of a range."""

    name = "Picky"
    x: float = 1.0

    def __post_init__(self) -> None:
        if 2 < self.x < 4:
            raise invalid(self, "x", self.x, "must not be between 2 and 4")

    def start(self, channels: Channels, onset: Array, rng: Generator) -> None:
        pass

    @staticmethod
    def rule() -> None:
        pass
