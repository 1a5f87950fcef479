"""One mission of several robots in MuJoCo."""

import re
from collections.abc import Sequence

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import SimulationError
from evoros.robot.model import Robot
from evoros.simulator.engines.mujoco_bodies import FIXED, MOVABLE, ROBOT
from evoros.simulator.engines.mujoco_model import Model, Settings
from evoros.simulator.engines.mujoco_simulation import MujocoSimulation
from evoros.simulator.engines.teams import name_robot, share_arrays

GROUND, OBSTACLE = -1, -2
"""What a shape belongs to that is no robot's."""

_PLACE = re.compile(r" at DOF (\d+)")
"""How a warning names a part of the state."""


class MujocoTeam:
    """The robots of ``model`` in their world, in steps that they make together."""

    def __init__(
        self, model: Model, robots: Sequence[Robot], settings: Settings, warnings: Sequence[str]
    ) -> None:
        self._robots, self._model, self._settings = robots, model, settings
        self._warnings = warnings
        self._members = [
            MujocoSimulation(model, robot, settings, warnings, number)
            for number, robot in enumerate(robots)
        ]
        self._shares = share_arrays(robots)
        groups = model.model.geom_group
        self._owners = np.where((groups == FIXED) | (groups == MOVABLE), OBSTACLE, GROUND)
        for number, parts in enumerate(model.robots):
            self._owners[parts.visible] = number
        self._visible = np.concatenate([parts.visible for parts in model.robots])

    def observe(self, states: Array) -> None:
        """Fill ``states`` with those of all robots.

        Raises:
            SimulationError: the engine has warned of something that it cannot simulate.
        """
        for member, share in zip(self._members, self._shares, strict=True):
            try:
                member.observe(states[share.state])
            except SimulationError as error:
                raise SimulationError(self._name_place(str(error))) from None

    def _name_place(self, warning: str) -> str:
        """Return a warning with the name of the robot that it is about, if it tells."""
        place = _PLACE.search(warning)
        firsts = [parts.root[1] for parts in self._model.robots]
        number = sum(first <= int(place[1]) for first in firsts) - 1 if place else -1
        return f"{name_robot(number, self._robots[number])}: {warning}" if number >= 0 else warning

    def sense(self, signals: Array) -> None:
        """Fill ``signals`` with those of all robots; none sees itself."""
        library, engine = self._model.library, self._model.model
        library.mj_kinematics(engine, self._model.data)
        for member, share, parts in zip(
            self._members, self._shares, self._model.robots, strict=True
        ):
            if share.signals.stop > share.signals.start:
                engine.geom_group[self._visible] = MOVABLE
                engine.geom_group[parts.visible] = ROBOT
                member.sense_placed(signals[share.signals])
        engine.geom_group[self._visible] = ROBOT

    def advance(self, commands: Array, duration: float) -> None:
        """Drive all robots for ``duration`` [s]; contact is tested in every step."""
        for member, share in zip(self._members, self._shares, strict=True):
            member.set_motors(commands[share.command])
        library, engine, data = self._model.library, self._model.model, self._model.data
        for _ in range(round(duration / self._settings.time_step)):
            library.mj_step(engine, data)
            if data.sensordata.any():
                self._report_contacts()

    def _report_contacts(self) -> None:
        """Report the contacts of robots with obstacles and with one another."""
        pairs = self._owners[self._model.data.contact.geom]
        for first, second in pairs.tolist():
            if GROUND not in (first, second):
                for number in (first, second):
                    if number >= 0:
                        self._members[number].report_contact()
        for member in self._members:
            member.feel()
