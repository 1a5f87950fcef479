"""The actions of ``import osc.evoros``; each class is an entry point of scenario_execution.

The parameters of ``execute`` and of constructors are those of ``lib_osc/evoros.osc``.
"""

import math
from collections.abc import Callable
from typing import Any, TypeVar

from py_trees.common import Status
from scenario_execution.actions.base_action import ActionError, BaseAction

from evoros.base.arrays import X, Y
from evoros.base.errors import EvorosError, InputError
from evoros.mission.opened import OpenMission
from evoros.openscenario.sensors import select_sensors, smallest_reading
from evoros.openscenario.simulation import Simulation
from evoros.storage.tables import OUTCOME_COLUMNS

T = TypeVar("T")


class Action(BaseAction):  # type: ignore[misc]
    """An action on the mission of a scenario."""

    def setup(self, **kwargs: Any) -> None:
        """Take the simulation."""
        simulation = self.get_simulation(kwargs)
        if not isinstance(simulation, Simulation):
            raise ActionError(
                f"{self.name}: needs --simulation evoros.openscenario.simulation:Simulation, or a "
                f"subclass, not {type(simulation).__name__}",
                action=self,
            )
        self.simulation = simulation
        self._attempt(self.prepare)

    def prepare(self) -> None:
        """Build what the action needs, before the scenario begins."""

    def update(self) -> Status:
        """Act at a tick of the scenario."""
        status = self._attempt(self.act)
        if status is None:
            self.feedback_message = self.simulation.problem
            return Status.FAILURE
        return status

    def act(self) -> Status:
        """Return the status of the action at this tick."""
        raise NotImplementedError

    def _attempt(self, function: Callable[[], T]) -> T | None:
        """Call a function; None if the scenario cannot go on."""
        if self.simulation.problem:
            return None
        try:
            return function()
        except EvorosError as error:
            self.simulation.stop(InputError(f"{self.name}: {error}"))
            return None

    @property
    def mission(self) -> OpenMission:
        """The mission of the scenario."""
        return self.simulation.mission

    def fail(self, reason: str) -> Status:
        """Fail, and tell the log and the tree why."""
        self.feedback_message = reason
        self.logger.error(f"{self.name}: {reason}")
        return Status.FAILURE


class Wait(Action):
    """An action that succeeds as soon as a condition holds, and fails if the mission ends first."""

    def holds(self) -> bool:
        """Whether the condition holds."""
        raise NotImplementedError

    def act(self) -> Status:
        """Succeed, wait or fail."""
        if self.holds():
            return Status.SUCCESS
        if self.mission.is_over:
            return self.fail(
                f"the mission has ended ({self.mission.ended}) at {self.mission.time_s:g} s"
            )
        return Status.RUNNING


class _Reading(Wait):
    """An action on the smallest reading of some sensors."""

    sensors: str
    channel = ""

    def read(self) -> float:
        """Return the smallest reading; NaN if all are silent."""
        robot = self.mission.robot
        numbers = select_sensors(robot, self.sensors)
        return smallest_reading(robot, self.mission.readings, numbers, self.channel)


class WaitForReading(_Reading):
    """Waits until the smallest reading lies between limits."""

    def execute(self, sensors: str, channel: str, at_least: float, at_most: float) -> None:
        """Take the parameters."""
        self.sensors, self.channel, self.limits = sensors, channel, (at_least, at_most)

    def holds(self) -> bool:
        """Whether it does."""
        low, high = self.limits
        return low <= self.read() <= high


class WaitForSilence(_Reading):
    """Waits until no sensor has a reading."""

    def execute(self, sensors: str) -> None:
        """Take the parameter."""
        self.sensors = sensors

    def holds(self) -> bool:
        """Whether all are silent."""
        return math.isnan(self.read())


class AskReading(_Reading):
    """Writes the smallest reading to a variable."""

    def __init__(self) -> None:
        super().__init__(resolve_variable_reference_arguments_in_execute=False)

    def execute(self, target_variable: Any, sensors: str, channel: str) -> None:
        """Take the parameters."""
        self.variable, self.sensors, self.channel = target_variable, sensors, channel

    def act(self) -> Status:
        """Write it."""
        reading = self.read()
        if math.isnan(reading):
            return self.fail(f"the sensors {self.sensors} are silent")
        self.variable.set_value(reading)
        return Status.SUCCESS


class WaitForPlace(Wait):
    """Waits until the robot is near a place."""

    def execute(self, x: float, y: float, within: float) -> None:
        """Take the place [m]."""
        self.place = x, y, within

    def holds(self) -> bool:
        """Whether it is there."""
        x, y, within = self.place
        state = self.mission.state
        return math.hypot(float(state[X]) - x, float(state[Y]) - y) <= within


class WaitForWaypoints(Wait):
    """Waits until the robot has reached so many waypoints."""

    def execute(self, count: int) -> None:
        """Take the number."""
        self.count = count

    def holds(self) -> bool:
        """Whether it has."""
        return self.mission.visited >= self.count


class Drive(Action):
    """Drives in place of the controller for a time."""

    def setup(self, **kwargs: Any) -> None:
        """Take the simulation and the scenario's clock."""
        super().setup(**kwargs)
        self._clock = kwargs["clock"]

    def execute(self, speed: float, steering: float, duration: float) -> None:
        """Take the command [m/s, rad] and the time [s]."""
        self._command, self._end = (speed, steering), self._clock.now() + duration

    def act(self) -> Status:
        """Drive, or give the robot back to its controller."""
        if self._clock.now() < self._end - self.simulation.dt / 2:
            self.simulation.command = self._command
            return Status.RUNNING
        self.simulation.command = None
        return Status.SUCCESS

    def request_cancel(self) -> bool:
        """Give the robot back to its controller."""
        self.simulation.command = None
        return True


class WaitForEnd(Wait):
    """Waits for the end of the mission, and judges it."""

    def execute(self, ended: str) -> None:
        """Take the end that is wanted."""
        self.ended = ended

    def holds(self) -> bool:
        """Whether it has ended so."""
        return self.mission.is_over and self.mission.ended == self.ended


class CheckMetric(Action):
    """Judges a metric of the mission so far."""

    def execute(self, metric: str, at_least: float, at_most: float) -> None:
        """Take the parameters."""
        self.metric, self.limits = metric, (at_least, at_most)

    def act(self) -> Status:
        """Compare it."""
        value = getattr(self.mission.outcomes()[0], self.metric, None)
        if self.metric not in OUTCOME_COLUMNS or not isinstance(value, bool | int | float):
            raise InputError(
                f"metric: must be a column of missions.csv with a number, not {self.metric}; "
                f"choose progress, for example"
            )
        low, high = self.limits
        if low <= value <= high:
            return Status.SUCCESS
        return self.fail(f"{self.metric} is {value:g}, and must be from {low:g} to {high:g}")
