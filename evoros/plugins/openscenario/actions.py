"""The actions of ``osc.evoros`` for scenario_execution, declared in ``lib_osc/evoros.osc``."""

import math
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from py_trees.common import Status
from scenario_execution.actions.base_action import ActionError, BaseAction

from evoros.base.arrays import Array, X, Y
from evoros.base.errors import EvorosError, InputError
from evoros.mission.rollout import OpenMission
from evoros.plugins.openscenario.simulation import Simulation
from evoros.robot.model import Robot
from evoros.storage.tables import OUTCOME_COLUMNS

ALL = "all"
T = TypeVar("T")


class Action(BaseAction):  # type: ignore[misc]
    """An action on the mission of a scenario."""

    def setup(self, **kwargs: Any) -> None:
        """Store the simulation and prepare the action."""
        simulation = self.get_simulation(kwargs)
        if not isinstance(simulation, Simulation):
            needed = "--simulation evoros.plugins.openscenario:Simulation, or a subclass"
            found = type(simulation).__name__
            raise ActionError(f"{self.name}: needs {needed}, not {found}", action=self)
        self.simulation = simulation
        self._attempt(self.prepare)

    def prepare(self) -> None:
        """Prepare the action, before the scenario starts."""

    def update(self) -> Status:
        """Perform the action in one tick of the scenario."""
        status = self._attempt(self.act)
        if status is None:
            self.feedback_message = self.simulation.problem
            return Status.FAILURE
        return status

    def act(self) -> Status:
        """Act, and return the status of the action after this tick."""
        raise NotImplementedError

    def _attempt(self, function: Callable[[], T]) -> T | None:
        if self.simulation.problem:
            return None
        try:
            return function()
        except EvorosError as error:
            self.simulation.stop(InputError(f"{self.name}: {error}"))
            return None

    @property
    def mission(self) -> OpenMission:
        """The scenario's mission."""
        return self.simulation.mission

    def fail(self, reason: str) -> Status:
        """Fail, and report the reason in the log and the behaviour tree."""
        self.feedback_message = reason
        self.logger.error(f"{self.name}: {reason}")
        return Status.FAILURE


class Wait(Action):
    """An action that succeeds when a condition holds, and fails if the mission ends first."""

    def holds(self) -> bool:
        """Return True if the condition holds."""
        raise NotImplementedError

    def act(self) -> Status:
        """Succeed if the condition holds, fail if the mission has ended, otherwise keep running."""
        if self.holds():
            return Status.SUCCESS
        if self.mission.is_over:
            ended = self.mission.ended
            return self.fail(f"the mission has ended ({ended}) at {self.mission.time_s:g} s")
        return Status.RUNNING


class _Reading(Wait):
    sensors: str
    channel = ""

    def read(self) -> float:
        """Return the minimum reading, or NaN if all sensors are silent."""
        robot = self.mission.robot
        numbers = select_sensors(robot, self.sensors)
        return _smallest_reading(robot, self.mission.readings, numbers, self.channel)


class WaitForReading(_Reading):
    """Waits until the minimum reading is within limits."""

    def execute(self, sensors: str, channel: str, at_least: float, at_most: float) -> None:
        """Store the parameters."""
        self.sensors, self.channel, self.limits = sensors, channel, (at_least, at_most)

    def holds(self) -> bool:
        """Return True if the minimum reading is within the limits."""
        low, high = self.limits
        return low <= self.read() <= high


class WaitForSilence(_Reading):
    """Waits until all selected sensors are silent."""

    def execute(self, sensors: str) -> None:
        """Store the sensors."""
        self.sensors = sensors

    def holds(self) -> bool:
        """Return True if all sensors are silent."""
        return math.isnan(self.read())


class AskReading(_Reading):
    """Writes the minimum reading to a scenario variable."""

    def __init__(self) -> None:
        super().__init__(resolve_variable_reference_arguments_in_execute=False)

    def execute(self, target_variable: Any, sensors: str, channel: str) -> None:
        """Store the parameters."""
        self.variable, self.sensors, self.channel = target_variable, sensors, channel

    def act(self) -> Status:
        """Write the reading."""
        reading = self.read()
        if math.isnan(reading):
            return self.fail(f"the sensors {self.sensors} are silent")
        self.variable.set_value(reading)
        return Status.SUCCESS


class WaitForPlace(Wait):
    """Waits until the robot is near a point."""

    def execute(self, x: float, y: float, within: float) -> None:
        """Store the point and the distance [m]."""
        self.place = x, y, within

    def holds(self) -> bool:
        """Return True if the robot is near the point."""
        x, y, within = self.place
        state = self.mission.state
        return math.hypot(float(state[X]) - x, float(state[Y]) - y) <= within


class WaitForWaypoints(Wait):
    """Waits until the robot has reached a given number of waypoints."""

    def execute(self, count: int) -> None:
        """Store the number."""
        self.count = count

    def holds(self) -> bool:
        """Return True if the robot has reached the given number of waypoints."""
        return self.mission.visited >= self.count


class Drive(Action):
    """Drives the robot for a given time instead of the controller."""

    def setup(self, **kwargs: Any) -> None:
        """Store the simulation and the clock of the scenario."""
        super().setup(**kwargs)
        self._clock = kwargs["clock"]

    def execute(self, speed: float, steering: float, duration: float) -> None:
        """Store the command [m/s, rad] and its end time [s]."""
        self._command, self._end = (speed, steering), self._clock.now() + duration

    def act(self) -> Status:
        """Drive, or return control to the controller."""
        if self._clock.now() < self._end - self.simulation.dt / 2:
            self.simulation.command = self._command
            return Status.RUNNING
        self.simulation.command = None
        return Status.SUCCESS

    def request_cancel(self) -> bool:
        """Return control to the controller."""
        self.simulation.command = None
        return True


class WaitForEnd(Wait):
    """Waits until the mission has ended in the expected way."""

    def execute(self, ended: str) -> None:
        """Store the expected ending."""
        self.ended = ended

    def holds(self) -> bool:
        """Return True if the mission has ended as expected."""
        return self.mission.is_over and self.mission.ended == self.ended


class CheckMetric(Action):
    """Checks that a metric of the mission so far is within limits."""

    def execute(self, metric: str, at_least: float, at_most: float) -> None:
        """Store the parameters."""
        self.metric, self.limits = metric, (at_least, at_most)

    def act(self) -> Status:
        """Compare the metric with the limits."""
        value = getattr(self.mission.outcomes()[0], self.metric, None)
        if self.metric not in OUTCOME_COLUMNS or not isinstance(value, bool | int | float):
            raise InputError(
                f"metric: must be a numeric column of missions.csv, not {self.metric}; "
                f"choose progress, for example"
            )
        low, high = self.limits
        if low <= value <= high:
            return Status.SUCCESS
        return self.fail(f"{self.metric} must be from {low:g} to {high:g}, not {value:g}")


def select_sensors(robot: Robot, text: str) -> list[int]:
    """Return the indices of the sensors selected by a string: all, numbers, or type names."""
    types = [mount.sensor for mount in robot.mounts]
    chosen: set[int] = set()
    for word in text.replace(",", " ").split():
        numbers = [int(word)] if word.isdecimal() else []
        found = [n for n, name in enumerate(types) if word in (ALL, name) or n in numbers]
        chosen.update(found)
        if not found:
            chosen.clear()
            break
    if not chosen:
        known = ", ".join(dict.fromkeys(types)) or "no sensors"
        raise InputError(
            f"sensors: must be all, numbers from 0 to {len(types) - 1}, or type names "
            f"({known}), not {text!r}; use all, for example"
        )
    return sorted(chosen)


def _smallest_reading(robot: Robot, readings: Array, numbers: Sequence[int], channel: str) -> float:
    """Return the minimum reading in channels that start with ``channel``; NaN if all are silent."""
    sensors = robot.mounted_sensors()
    values = []
    for number in numbers:
        pairs = zip(readings[robot.layout[number]], sensors[number].channels, strict=True)
        values += [float(value) for value, kind in pairs if kind.name.startswith(channel)]
    if not values:
        names = [kind.name for number in numbers for kind in sensors[number].channels]
        raise InputError(
            f"channel: must be the start of a channel's name ({', '.join(dict.fromkeys(names))}), "
            f"not {channel!r}; leave channel out to use all channels"
        )
    return min((value for value in values if not math.isnan(value)), default=math.nan)
