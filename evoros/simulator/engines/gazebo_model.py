"""A server of Gazebo's physics with the simulations that it holds, which it opens or resets."""

from collections import OrderedDict
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from evoros.base.arrays import Array
from evoros.base.errors import SimulationError
from evoros.simulator.engines.gazebo_server import GazeboServer, Operation
from evoros.simulator.engines.gazebo_world import Settings, describe_scene
from evoros.simulator.engines.teams import describe_for_engine, name_robots
from evoros.simulator.protocol import PlacedRobot
from evoros.world.model import World

KEPT = 4
"""Simulations that are kept: a design meets each world of a run in turn, in every trial."""


class Scene(NamedTuple):
    """A simulation in a server, and its values at the start of a mission."""

    server: GazeboServer
    number: int
    values: Array


class Engine:
    """A server, which no two missions use at a time."""

    def __init__(self, program: Path, limit_s: float) -> None:
        self._server = GazeboServer(program, limit_s)
        self._kept: OrderedDict[tuple[Any, ...], int] = OrderedDict()
        self._numbers = count()

    def close(self) -> None:
        """End the server; the engine cannot be used any more."""
        self._server.close()

    def limit(self, seconds: float) -> None:
        """Let each answer take at most a wall-clock time [s]."""
        self._server.limit_s = seconds

    def forget(self) -> None:
        """Make the next missions open their simulations."""
        while self._kept:
            self._drop_oldest()

    def prepare(self, robots: Sequence[PlacedRobot], world: World, settings: Settings) -> Scene:
        """The simulation at the start of a mission: reset if it is kept, or else opened.

        Raises:
            SimulationError: Gazebo refuses a robot or the world.
            PilotLost: the server ended or hangs.
        """
        described = tuple((*describe_for_engine(robot), home) for robot, home in robots)
        sizes = () if world.crowd is None else world.crowd.sizes
        source = (described, world.bodies, world.gravity_mps2, settings, sizes)
        number = self._kept.pop(source, None)
        if number is not None:
            values = self._server.ask(Operation.RESET, number)
        else:
            number = next(self._numbers)
            values = self._open(number, robots, world, settings)
        self._kept[source] = number
        while len(self._kept) > KEPT:
            self._drop_oldest()
        return Scene(self._server, number, values)

    def _open(
        self, number: int, robots: Sequence[PlacedRobot], world: World, settings: Settings
    ) -> Array:
        scene = describe_scene(robots, world, settings)
        try:
            return self._server.ask(Operation.OPEN, number, scene)
        except SimulationError as error:
            raise SimulationError(
                f"{name_robots(robots)} in the world {world.name!r}: {error}; use simulator=mujoco"
            ) from error

    def _drop_oldest(self) -> None:
        _, number = self._kept.popitem(last=False)
        self._server.ask(Operation.FORGET, number)
