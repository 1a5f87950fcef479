"""One mission of several robots in PyBullet."""

from collections.abc import Sequence
from typing import Any

from evoros.base.arrays import Array
from evoros.robot.model import Robot
from evoros.simulator.engines.pybullet_model import Model, Settings
from evoros.simulator.engines.pybullet_simulation import PyBulletSimulation
from evoros.simulator.engines.teams import share_arrays


class PyBulletTeam:
    """The robots of ``model`` in their world, in steps that they make together."""

    def __init__(
        self, bullet: Any, client: int, model: Model, robots: Sequence[Robot], settings: Settings
    ) -> None:
        self._bullet, self._client, self._model = bullet, client, model
        self._time_step = settings.time_step
        self._shares = share_arrays(robots)
        self._members = [
            PyBulletSimulation(bullet, client, model, robot, settings, number)
            for number, robot in enumerate(robots)
        ]

    def observe(self, states: Array) -> None:
        """Fill ``states`` with those of all robots."""
        for member, share in zip(self._members, self._shares, strict=True):
            member.observe(states[share.state])

    def sense(self, signals: Array) -> None:
        """Fill ``signals`` with those of all robots; none sees itself."""
        for member, share in zip(self._members, self._shares, strict=True):
            member.sense(signals[share.signals])

    def advance(self, commands: Array, duration: float) -> None:
        """Drive all robots for ``duration`` [s]; contact is tested after every step."""
        for member, share in zip(self._members, self._shares, strict=True):
            member.take(commands[share.command])
        step, client, members = self._bullet.stepSimulation, self._client, self._members
        for _ in range(round(duration / self._time_step)):
            substeps = 1
            if self._model.watched:
                disturbed = any(member.is_disturbed() for member in members)
                for member in members:
                    substeps = member.adapt_step(disturbed)
            for _ in range(substeps):
                step(client)
                for member in members:
                    member.report_contact()
