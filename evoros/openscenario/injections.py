"""The actions of ``import osc.evoros`` that let parts of the robot fail."""

import math

from py_trees.common import Status

from evoros.base.errors import InputError
from evoros.failure.case import Case
from evoros.failure.protocol import Fault
from evoros.failure.trigger import is_timed
from evoros.filter.protocol import READINGS
from evoros.openscenario.actions import Action
from evoros.openscenario.sensors import select_sensors
from evoros.openscenario.setting import split_words

PARTS = ("steering", "drive", "wheel", "localization", "commands")
"""The failure models of parts that can fail at once."""


class InjectFailure(Action):
    """Lets a failure model choose what fails."""

    def __init__(self, failure: str, effect: str, onset: str, settings: str) -> None:
        super().__init__()
        self.failure_model, self.effect, self.onset = failure, effect, onset
        self.settings = settings

    def list_overrides(self) -> list[str]:
        """Return the overrides that choose the failure model."""
        chosen = {"filter@failure.effect": self.effect, "failure/onset": self.onset}
        words = split_words("settings", self.settings)
        return [
            f"failure={self.failure_model}",
            *(f"{group}={choice}" for group, choice in chosen.items() if choice),
            *(f"failure.{word}" for word in words),
        ]

    def prepare(self) -> None:
        """Build the failure model."""
        self.failure = self.simulation.build_failure(*self.list_overrides())

    def act(self) -> Status:
        """Let it draw its faults."""
        for fault in self.mission.add_failure(self.failure):
            self.simulation.check_event(fault.trigger)
            self.logger.info(f"{self.name}: {fault.effect} of {describe_fault(fault)}")
        return Status.SUCCESS


class InjectFault(InjectFailure):
    """Lets stated sensors fail at once."""

    def __init__(self, sensors: str, effect: str, settings: str) -> None:
        super().__init__("given", effect, "", settings)
        self.sensors = sensors

    def list_overrides(self) -> list[str]:
        """Return the overrides that state the fault."""
        numbers = select_sensors(self.mission.robot, self.sensors)
        words = split_words("settings", self.settings)
        return [
            "failure=given",
            f"failure.sensors=[{','.join(map(str, numbers))}]",
            f"filter@failure.effect={self.effect}",
            *(f"failure.effect.{word}" for word in words),
        ]


class InjectPartFault(InjectFailure):
    """Lets another part than a sensor fail at once."""

    def __init__(self, part: str, effect: str, settings: str) -> None:
        super().__init__(part, effect, "time", settings)

    def list_overrides(self) -> list[str]:
        """Return the overrides that state the fault.

        Raises:
            InputError: there is no such part.
        """
        if self.failure_model not in PARTS:
            raise InputError(
                f"part: must be one of {', '.join(PARTS)}, not {self.failure_model}; use "
                f"inject_failure for another failure model"
            )
        now = ("failure.onset.earliest_s=0", "failure.onset.latest_s=0")
        return [*super().list_overrides(), *now]


def describe_fault(fault: Fault) -> str:
    """Describe what fails in a message, and the time [s] or the kind of the event."""
    onsets = fault.onset.tolist()
    if fault.signal == READINGS:
        failing = enumerate(onsets)
        return Case.of((sensor, time) for sensor, time in failing if math.isfinite(time)).text
    return f"{fault.part}@{onsets[0]!r}" if is_timed(fault.trigger) else fault.part
