"""Starts the faults of other parts than sensors: of the pose, of commands, of drives."""

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import COMMAND_SIZE, Array, copy_values
from evoros.base.rng import generator
from evoros.compilation.named_rules import bind
from evoros.failure.protocol import Fault
from evoros.failure.trigger import NEVER
from evoros.filter.protocol import COMMAND, DRIVE, POSE, Channels
from evoros.mission.inputs import FilterStage
from evoros.mission.participant import Participant
from evoros.mission.pipeline import Clocks, describe_pose, start_filter
from evoros.robot.model import Robot
from evoros.sensor.protocol import SENSOR_ARGUMENTS

COMMAND_NAMES = "speed", "steering"


def start_pose_faults(participant: Participant, pose: Array, clocks: Clocks) -> list[FilterStage]:
    """Start the faults of a robot's localization, after all else that makes its ``pose``."""
    channels = describe_pose(participant.member.controller.period_s)
    return _start_faults(participant, POSE, channels, pose, clocks)


def spoils_commands(faults: Sequence[Fault]) -> bool:
    """Whether any of the faults changes commands on their way to the drive."""
    return any(fault.signal in (COMMAND, DRIVE) for fault in faults)


def start_actuation(
    participant: Participant, command: Array, driven: Array, clocks: Clocks
) -> list[FilterStage]:
    """Start the stages between a controller's ``command`` and what its drive gets, ``driven``.

    Faults of commands come before faults of the drive. A value that is silent after either does not
    arrive: the one before it stands.
    """
    channels = describe_commands(participant.robot, participant.member.controller.period_s)
    if not spoils_commands(participant.faults):
        return [_start_copy(_copy, command, driven)]
    sent, received, wanted = np.zeros((3, COMMAND_SIZE))
    return [
        _start_copy(_copy, command, sent),
        *_start_faults(participant, COMMAND, channels, sent, clocks),
        _start_copy(_receive, sent, received),
        _start_copy(_copy, received, wanted),
        *_start_faults(participant, DRIVE, channels, wanted, clocks),
        _start_copy(_receive, wanted, driven),
    ]


def describe_commands(robot: Robot, period: float) -> Channels:
    """Describe the commands that a robot gets each ``period`` [s]."""
    unlimited = np.full(COMMAND_SIZE, np.inf)
    stops = np.array([robot.drive.max_speed_mps, robot.drive.steering_limit])
    places = np.zeros((COMMAND_SIZE, 3))
    return Channels(-unlimited, unlimited, places, period, COMMAND_NAMES, COMMAND, stops)


def _start_faults(
    participant: Participant, signal: str, channels: Channels, values: Array, clocks: Clocks
) -> list[FilterStage]:
    """Start the faults of a signal; the draws of each depend on its index among those of its name.

    Faults of other signals shift none.
    """
    counts: Counter[str] = Counter()
    stages = []
    for fault in participant.faults:
        if fault.signal != signal:
            continue
        rng = participant.draws(f"fault.{fault.name}.{counts[fault.name]}.{fault.part}")
        counts[fault.name] += 1
        if math.isfinite(fault.onset[0]):
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
