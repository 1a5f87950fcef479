"""The actions of ``osc.evoros`` that make parts of the robot fail."""

import math

from py_trees.common import Status

from evoros.base.errors import InputError
from evoros.failure.protocol import Case, Fault, is_timed
from evoros.filter.protocol import READINGS
from evoros.plugins.openscenario.actions import Action, select_sensors
from evoros.plugins.openscenario.simulation import split_words

PARTS = ("steering", "drive", "wheel", "localization", "commands")
"""Failure models, named after robot parts, whose faults can start immediately."""


class InjectFailure(Action):
    """Adds faults drawn by a failure model."""

    def __init__(self, failure: str, effect: str, onset: str, settings: str) -> None:
        super().__init__()
        self.failure_model, self.effect, self.onset = failure, effect, onset
        self.settings = settings

    def list_overrides(self) -> list[str]:
        """Return the overrides that select the failure model."""
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
        """Draw faults, and add them to the mission."""
        for fault in self.mission.add_failure(self.failure):
            self.simulation.check_event(fault.trigger)
            self.logger.info(f"{self.name}: {fault.effect} of {describe_fault(fault)}")
        return Status.SUCCESS


class InjectFault(InjectFailure):
    """Makes the given sensors fail immediately."""

    def __init__(self, sensors: str, effect: str, settings: str) -> None:
        super().__init__("given", effect, "", settings)
        self.sensors = sensors

    def list_overrides(self) -> list[str]:
        """Return the overrides that specify the fault."""
        numbers = select_sensors(self.mission.robot, self.sensors)
        words = split_words("settings", self.settings)
        return [
            "failure=given",
            f"failure.sensors=[{','.join(map(str, numbers))}]",
            f"filter@failure.effect={self.effect}",
            *(f"failure.effect.{word}" for word in words),
        ]


class InjectPartFault(InjectFailure):
    """Makes a part other than a sensor fail immediately."""

    def __init__(self, part: str, effect: str, settings: str) -> None:
        super().__init__(part, effect, "time", settings)

    def list_overrides(self) -> list[str]:
        """Return the overrides that specify the fault."""
        if self.failure_model not in PARTS:
            raise InputError(
                f"part: must be one of {', '.join(PARTS)}, not {self.failure_model}; use "
                f"inject_failure for another failure model"
            )
        now = ("failure.onset.earliest_s=0", "failure.onset.latest_s=0")
        return [*super().list_overrides(), *now]


def describe_fault(fault: Fault) -> str:
    """Describe the failing parts, with onsets [s] where set."""
    onsets = fault.onset.tolist()
    if fault.signal == READINGS:
        failing = enumerate(onsets)
        return Case.of((sensor, time) for sensor, time in failing if math.isfinite(time)).text
    return f"{fault.part}@{onsets[0]!r}" if is_timed(fault.trigger) else fault.part
