"""The parts that all missions of an experiment share, checked to fit together."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated

from evoros.base.checks import checked, instance_of
from evoros.base.errors import InputError
from evoros.controller.protocol import A_CONTROLLER, Controller, LiveController
from evoros.design.design import Design
from evoros.design.genes import replace_values
from evoros.design.space import SensorDesign
from evoros.failure.protocol import Failure
from evoros.filter.protocol import Filter
from evoros.mission.outcome import AGENT_COLUMNS, ESTIMATE
from evoros.robot.model import Robot
from evoros.sensor.protocol import Sensor, add_prices, name_channels
from evoros.simulator.protocol import (
    A_SIMULATOR,
    SelectiveSimulator,
    Simulator,
    TeamSimulator,
    measured_by,
)
from evoros.world.model import World


def require_world(name: str, world: object) -> None:
    """Refuse what the configuration has among the worlds and is none.

    Raises:
        InputError: it is no world.
    """
    if not isinstance(world, World):
        raise InputError(
            f"world.{name}: must be a world, and some of its keys are missing; choose it with "
            f"world=[...], or remove world.{name}"
        )


@dataclass(frozen=True, eq=False)  # so it can be the key of what is computed from it once
@checked
class Scenario:
    """Everything that a mission needs besides its design, the name of its world and its draws.

    The fields are named like the groups of the configuration, so that the key of an evolved value,
    for example ``controller.avoidance.range_m``, is also its path in a scenario. ``agents`` are the
    scenarios of the other robots in the world, which have this simulator and none of their own.

    Raises:
        InputError: a part of the wrong kind, a world that the simulator cannot simulate, a period
            that is no multiple of the time step, or a time limit that is no multiple of the
            controller's period.
    """

    robot: Annotated[Robot, instance_of(Robot, "a robot")]
    world: Annotated[Mapping[str, World], instance_of(Mapping, "a mapping from names to worlds")]
    design: Annotated[SensorDesign, instance_of(SensorDesign, "a sensor design")]
    failure: Annotated[Failure, instance_of(Failure, "a failure model (draw)")]
    controller: Annotated[Controller | LiveController, A_CONTROLLER]
    simulator: Annotated[Simulator, A_SIMULATOR]
    agents: Mapping[str, "Scenario"] = field(default_factory=dict)
    awaited: bool = True  # whether a mission goes on until this robot has ended
    shares_design: bool = True  # whether its design is the first robot's

    def __post_init__(self) -> None:
        if not self.world:
            raise InputError("world: must have at least one world, not none; add world=case_study")
        for name, world in self.world.items():
            require_world(name, world)
            self._check_world(name, world)
        self.count_steps("controller.period_s", self.controller.period_s)
        for name, sensor in self.design.sensors.items():
            self.count_steps(f"design.sensors.{name}.period_s", sensor.period_s)
            self._check_measured(name, sensor)
        for name, world in self.world.items():
            self._check_limit(name, world.course.time_limit_s)
        if self.agents and not isinstance(self.simulator, TeamSimulator):
            raise InputError(
                f"agents: must be empty with a simulator of one robot, "
                f"{type(self.simulator).__name__}; use simulator=planar or simulator=physics, or "
                f"give it the method open_team"
            )

    def _check_world(self, name: str, world: World) -> None:
        if isinstance(self.simulator, SelectiveSimulator):
            try:
                self.simulator.check_world(world)
            except InputError as error:
                raise InputError(f"world.{name}: {error}") from None

    def _check_measured(self, name: str, sensor: Sensor) -> None:
        offered = measured_by(self.simulator)
        if sensor.measures not in offered:
            raise InputError(
                f"design.sensors.{name}: measures {sensor.measures}, which "
                f"{type(self.simulator).__name__} does not offer to sensors (it offers "
                f"{', '.join(offered)}); remove that sensor, or choose another simulator"
            )

    def _check_limit(self, world: str, limit: float) -> None:
        """Require that a mission can end at its time limit and not after it.

        The tick of every mission divides the controller's period, whatever sensors a design has.
        """
        period = self.controller.period_s
        count = max(1, round(limit / period))
        if not math.isclose(count * period, limit, rel_tol=1e-9):
            raise InputError(
                f"world.{world}.course.time_limit_s: must be a whole multiple of "
                f"controller.period_s ({period:g} s), not {limit:g} s; set it to "
                f"{count * period:g}"
            )

    def count_steps(self, key: str, period: float) -> int:
        """Return the number of time steps in a period [s], which ``key`` names in messages.

        Raises:
            InputError: the period is no whole multiple of the time step.
        """
        step = self.simulator.time_step
        count = round(period / step)
        if count < 1 or not math.isclose(count * step, period, rel_tol=1e-9):
            nearest = max(1, count) * step
            raise InputError(
                f"{key}: must be a whole multiple of simulator.time_step ({step:g} s), "
                f"not {period:g} s; set it to {nearest:g}, or choose another step"
            )
        return count

    def with_design(self, design: Design) -> "Scenario":
        """Return this scenario with the design's sensors on the robot and its evolved values.

        Raises:
            InputError: a value that the part refuses, a sensor that cannot be mounted.
        """
        scenario = replace_values(self, design.values)
        return replace(
            scenario, robot=scenario.robot.with_sensors(design.mounts, scenario.design.sensors)
        )

    @property
    def is_live(self) -> bool:
        """Whether a program outside of this process controls any of the robots."""
        return any(
            isinstance(each.controller, LiveController) for each in (self, *self.agents.values())
        )

    def equip(self, design: Design) -> dict[str, "Scenario"]:
        """Return the scenarios of all robots with their designs, by name; the first one's is "".

        Raises:
            InputError: see ``with_design`` and ``find_design``; the message names the robot.
        """
        unknown = [name for name in design.agents if name not in self.agents]
        if unknown:
            raise InputError(
                f"agents: must have {unknown[0]}, for which there is a design, not "
                f"{', '.join(self.agents) or 'none'}; add it, or leave its design out"
            )
        designs = {name: self.find_design(name, design) for name in self.agents}
        team = {"": self.with_design(design)}
        for name, agent in self.agents.items():
            try:
                team[name] = agent.with_design(designs[name])
            except InputError as error:
                raise InputError(f"agents.{name}: {error}") from None
        return team

    def find_design(self, name: str, design: Design) -> Design:
        """Return the design of one of the robots; the first one's name is empty.

        Raises:
            InputError: a robot with a design of its own has none in ``design``, or one that shares
                the first robot's has.
        """
        if not name:
            return design
        own, shares = design.agents.get(name), self.agents[name].shares_design
        if shares and own is not None:
            raise InputError(
                f"agents.{name}.design: must not be null, because the design has one for this "
                f"robot alone; choose one with +design@agents.{name}.design=..., as in the run"
            )
        if not shares and own is None:
            raise InputError(
                f"agents.{name}.design: must be null for a design that has none for this robot; "
                f"give it one, or remove that key"
            )
        return design if own is None else own

    def count_sensors(self, design: Design) -> list[tuple[int, float]]:
        """Return the number and the price of the sensors of each robot, as they are configured."""
        robots = {"": self, **self.agents}
        mounts = {name: self.find_design(name, design).mounts for name in robots}
        return [
            (len(mounts[name]), add_prices(mounts[name], robot.design.sensors))
            for name, robot in robots.items()
        ]

    def name_columns(self, design: Design) -> list[str]:
        """Return the columns of a trajectory that follow those of ``TRAJECTORY``.

        These are the readings of the first robot, with its estimated pose if it has one, and then
        all of each other robot.
        """
        columns = self._name_readings(design)
        for name, agent in self.agents.items():
            own = (*AGENT_COLUMNS, *agent._name_readings(self.find_design(name, design)))
            columns += [f"{name}.{column}" for column in own]
        return columns

    def _name_readings(self, design: Design) -> list[str]:
        """Return the columns of the readings of a design's sensors, and of the estimated pose.

        A design that a part refuses has those of the sensors before its values are set.
        """
        try:
            sensors = self.with_design(design).design.sensors
        except InputError:
            sensors = self.design.sensors
        readings = name_channels(sensors[mount.sensor] for mount in design.mounts)
        return [*readings, *self.pose_columns]

    @property
    def pose_columns(self) -> tuple[str, ...]:
        """The columns of a trajectory for the pose that the robot takes for its own.

        There are none if filters change the true pose.
        """
        parts = self.controller.localization.values()
        return ESTIMATE if any(not isinstance(part, Filter) for part in parts) else ()
