"""Starts the faults of other parts than sensors: of the pose, of commands, of drives, of wheels."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import COMMAND_SIZE, STRENGTH_SIZE, Array, copy_values
from evoros.base.rng import generator
from evoros.compilation.named_rules import bind
from evoros.failure.protocol import Fault
from evoros.failure.trigger import NEVER
from evoros.filter.protocol import COMMAND, DRIVE, POSE, STRENGTH, Channels
from evoros.mission.inputs import Arrays, FilterStage
from evoros.mission.participant import Participant
from evoros.mission.pipeline import Clocks, describe_pose, start_filter
from evoros.robot.model import Robot
from evoros.sensor.protocol import SENSOR_ARGUMENTS

COMMAND_NAMES = "speed", "steering"
WHEEL_NAMES = "left wheel", "right wheel"


def start_pose_faults(
    participant: Participant, pose: Array, clocks: Clocks, begun: int = 0
) -> list[FilterStage]:
    """Start the faults of a robot's localization, after all else that makes its ``pose``.

    The first ``begun`` of all its faults have been started before, here and below.
    """
    channels = describe_pose(participant.member.controller.period_s)
    return _start_faults(participant, POSE, channels, pose, clocks, begun)


def spoils(faults: Sequence[Fault], *signals: str) -> bool:
    """Whether any of the faults changes one of the signals."""
    return any(fault.signal in signals for fault in faults)


@dataclass(frozen=True)
class Actuation:
    """The stages between the ``command`` of a robot's controller and what its drive gets.

    Faults of commands come before faults of the drive. A value that is silent after either does not
    arrive: the one before it stands. A wheel whose strength is silent stands still.
    """

    command: Array  # (COMMAND_SIZE,)
    driven: Array  # (COMMAND_SIZE,)
    strength: Array  # (STRENGTH_SIZE,) of the wheels; empty if none can fail
    faults: Mapping[str, list[FilterStage]] = field(
        default_factory=lambda: {COMMAND: [], DRIVE: [], STRENGTH: []}
    )
    sent: Array = field(default_factory=lambda: np.zeros(COMMAND_SIZE))
    received: Array = field(default_factory=lambda: np.zeros(COMMAND_SIZE))
    wanted: Array = field(default_factory=lambda: np.zeros(COMMAND_SIZE))
    shares: Array = field(default_factory=lambda: np.ones(STRENGTH_SIZE))

    def add(self, participant: Participant, clocks: Clocks, begun: int = 0) -> None:
        """Start the robot's faults of these signals."""
        period = participant.member.controller.period_s
        commands = describe_commands(participant.robot, period)
        for signal, channels, values in (
            (COMMAND, commands, self.sent),
            (DRIVE, commands, self.wanted),
            (STRENGTH, describe_strength(period), self.shares),
        ):
            self.faults[signal].extend(
                _start_faults(participant, signal, channels, values, clocks, begun)
            )

    @property
    def stages(self) -> list[FilterStage]:
        """The stages in their order."""
        stages = [_start_copy(_copy, self.command, self.driven)]
        if self.faults[COMMAND] or self.faults[DRIVE]:
            stages = [
                _start_copy(_copy, self.command, self.sent),
                *self.faults[COMMAND],
                _start_copy(_receive, self.sent, self.received),
                _start_copy(_copy, self.received, self.wanted),
                *self.faults[DRIVE],
                _start_copy(_receive, self.wanted, self.driven),
            ]
        if self.faults[STRENGTH]:
            full = np.ones(STRENGTH_SIZE)
            stages += [
                _start_copy(_copy, full, self.shares),
                *self.faults[STRENGTH],
                _start_copy(_weaken, self.shares, self.strength),
            ]
        return stages


def make_driven(arrays: Arrays, robots: int, faults: Sequence[Fault]) -> Array:
    """Return the commands that drives get if these faults come, too, and strengths if any has."""
    weak = len(arrays.driven) == robots * COMMAND_SIZE and spoils(faults, STRENGTH)
    if weak:
        return np.concatenate([arrays.driven, np.ones(robots * STRENGTH_SIZE)])
    is_new = arrays.driven is arrays.commands and spoils(faults, COMMAND, DRIVE)
    return arrays.commands.copy() if is_new else arrays.driven


def wire(actuations: Sequence[Actuation | None], commands: Array, driven: Array) -> list[Actuation]:
    """Return the stages of all robots between their commands and what drives get."""
    wired, strengths = [], driven[len(commands) :]
    for index, actuation in enumerate(actuations):
        part = slice(index * COMMAND_SIZE, (index + 1) * COMMAND_SIZE)
        strength = strengths[index * STRENGTH_SIZE :][:STRENGTH_SIZE]
        command = commands[part]
        if actuation is None:
            actuation = Actuation(command, driven[part], strength, received=command.copy())
        wired.append(replace(actuation, driven=driven[part], strength=strength))
    return wired


def describe_commands(robot: Robot, period: float) -> Channels:
    """Describe the commands that a robot gets each ``period`` [s]."""
    unlimited = np.full(COMMAND_SIZE, np.inf)
    stops = np.array([robot.drive.max_speed_mps, robot.drive.steering_limit])
    places = np.zeros((COMMAND_SIZE, 3))
    return Channels(-unlimited, unlimited, places, period, COMMAND_NAMES, COMMAND, stops)


def describe_strength(period: float) -> Channels:
    """Describe the strength of a robot's wheels, which counts at each decision of a ``period``."""
    low, high, full = np.zeros(2), np.full(2, np.inf), np.ones(2)
    return Channels(low, high, np.zeros((2, 3)), period, WHEEL_NAMES, STRENGTH, full)


def _start_faults(
    participant: Participant,
    signal: str,
    channels: Channels,
    values: Array,
    clocks: Clocks,
    begun: int,
) -> list[FilterStage]:
    """Start the faults of a signal; the draws of each depend on its index among those of its name.

    Faults of other signals shift none.
    """
    counts: Counter[str] = Counter()
    stages = []
    for index, fault in enumerate(participant.faults):
        if fault.signal != signal:
            continue
        number = counts[fault.name]
        counts[fault.name] += 1
        if index >= begun and math.isfinite(fault.onset[0]):
            rng = participant.draws(f"fault.{fault.name}.{number}.{fault.part}")
            onset = np.full(channels.size, NEVER)
            onset[list(fault.values) or slice(None)] = fault.onset[0]
            stage = start_filter(fault.filter, channels, onset, rng, values, 1)
            stages.append(stage._replace(clock=clocks.get(fault.trigger, 0)))
    return stages


def _start_copy(rule: object, source: Array, values: Array) -> FilterStage:
    return FilterStage(1, *bind(rule, SENSOR_ARGUMENTS, None), _NO_DRAWS, source, values)  # type: ignore[arg-type]


_NO_DRAWS: Generator = generator("", "copy")
"""For rules that draw nothing."""


def _copy(signal: Array, values: Array) -> None:
    """Copy all values."""
    copy_values(signal, values)


def _receive(signal: Array, values: Array) -> None:
    """Copy the values that are not silent."""
    for i in range(len(values)):
        if not math.isnan(signal[i]):
            values[i] = signal[i]


def _weaken(signal: Array, values: Array) -> None:
    """Clip the values to 0 and 1; those that are silent are 0."""
    for i in range(len(values)):
        values[i] = 0.0 if math.isnan(signal[i]) else min(max(signal[i], 0.0), 1.0)
