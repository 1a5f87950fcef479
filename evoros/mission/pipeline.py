"""Starts the filters and faults between sensors, controller and drive."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import COMMAND_SIZE, NO_VALUES, POSE_SIZE, STRENGTH_SIZE, Array, copy_values
from evoros.base.checks import require
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.compilation.named_rules import bind, start_rule
from evoros.controller.protocol import ESTIMATOR_ARGUMENTS, Controller, LiveController
from evoros.failure.protocol import NEVER, Fault, Trigger
from evoros.filter import protocol
from evoros.mission.inputs import FilterStage, LayerStage
from evoros.mission.participant import Draws, Participant
from evoros.robot.model import Robot
from evoros.sensor.protocol import SENSOR_ARGUMENTS, is_signal_sensor

Clocks = Mapping[Trigger, int]  # index in ``Arrays.clocks`` of each of a robot's triggers


class Pipeline:
    """The stages of one robot, keyed by the signal that they change."""

    def __init__(
        self,
        participant: Participant,
        layers: Sequence[LayerStage],
        signals: Array,
        readings: Array,
        pose: Array,
        tick: float,
    ) -> None:
        robot, draws = participant.robot, participant.draws
        controller = participant.member.controller
        sensors = list_sensor_targets(robot, readings, tick)
        place = describe_pose(pose, controller.period_s)
        self.participant, self.layers = participant, layers
        self.stages: dict[str, list[FilterStage]] = {signal: [] for signal in protocol.SIGNALS}
        self.stages[protocol.READINGS] = start_sensors(robot, sensors, signals, draws)
        self.stages[protocol.POSE] = start_localization(controller, robot, readings, place, draws)
        self.faults: list[Fault] = []
        self.actuation: Actuation | None = None  # None if the drive receives the commands directly
        self._targets = [*sensors, place]

    def connect(self, command: Array) -> None:
        """Insert fault stages between the controller's ``command`` and the drive."""
        if self.actuation is None:
            robot, controller = self.participant.robot, self.participant.member.controller
            self.actuation = Actuation(command)
            self._targets += self.actuation.list_targets(robot, controller.period_s)

    def add_faults(self, faults: Sequence[Fault], clocks: Clocks) -> None:
        """Start faults that act after all earlier stages of their signals."""
        for target in self._targets:
            stages = start_faults(faults, target, self.participant.draws, clocks)
            self.stages[target.channels.signal] += stages
        self.faults += faults


class Target(NamedTuple):
    """Values that filters and faults change: the pose, or the readings of a sensor type."""

    channels: protocol.Channels
    values: Array
    every: int = 1  # number of ticks between two samples
    name: str = ""  # name of the sensor type; empty for other signals
    sensors: slice = slice(0)  # index range of this type's sensors

    def spread(self, fault: Fault) -> Array:
        """Return the onset [s] of a fault per channel; all channels of a sensor fail together."""
        if self.name:
            onset = fault.onset[self.sensors]
            return np.repeat(onset, self.channels.size // len(onset))
        spread = np.full(self.channels.size, NEVER)
        spread[list(fault.values) or slice(None)] = fault.onset[0]
        return spread


def start_faults(
    faults: Sequence[Fault], target: Target, draws: Draws, clocks: Clocks
) -> list[FilterStage]:
    """Start the faults of a target, each with a separate random stream."""
    stages = []
    for fault in faults:
        if fault.signal != target.channels.signal:
            continue
        onset = target.spread(fault)
        if np.isfinite(onset).any():
            rng = draws(f"fault.{fault.name}.{fault.number}.{target.name or fault.part}")
            stage = start_filter(fault.filter, target, onset, rng)
            stages.append(stage._replace(clock=clocks.get(fault.trigger, 0)))
    return stages


def list_sensor_targets(robot: Robot, readings: Array, tick: float) -> list[Target]:
    """Return a target for each sensor type of a robot, with views of ``readings`` (channels,)."""
    names = [mount.sensor for mount in robot.mounts]
    targets = []
    for name in dict.fromkeys(names):
        first, count = names.index(name), names.count(name)
        sensors = slice(first, first + count)
        channels = _describe_channels(robot, sensors)
        values = readings[robot.layout[first].start : robot.layout[sensors.stop - 1].stop]
        every = round(channels.period / tick)
        targets.append(Target(channels, values, every, name, sensors))
    return targets


def _describe_channels(robot: Robot, sensors: slice) -> protocol.Channels:
    sensor, count = robot.mounted_sensors()[sensors.start], sensors.stop - sensors.start
    channels = sensor.channels
    return protocol.Channels(
        low=np.array([channel.low for channel in channels] * count),
        high=np.array([channel.high for channel in channels] * count),
        position=np.repeat(robot.sensor_poses[sensors, :3], len(channels), axis=0),
        period=sensor.period_s,
        names=tuple(channel.name for channel in channels) * count,
    )


def start_sensors(
    robot: Robot, targets: Sequence[Target], signals: Array, draws: Draws
) -> list[FilterStage]:
    """Start the measurement and the filters of each sensor type."""
    stages: list[FilterStage] = []
    for target in targets:
        part, sensor = f"sensor.{target.name}", robot.sensors[target.name]
        parts = robot.signal_layout[target.sensors]
        if is_signal_sensor(sensor):
            rng = draws(part)
            for signal, values in zip(parts, np.split(target.values, len(parts)), strict=True):
                rule = start_rule(sensor.rule, SENSOR_ARGUMENTS, sensor.start)
                stages.append(FilterStage(target.every, *rule, rng, signals[signal], values))
        else:  # the simulated ranges are the readings
            source = signals[parts[0].start : parts[-1].stop]
            copy = _start_copy(copy_signal, source, target.values)
            stages.append(copy._replace(every=target.every))
        stages += _start_filters(part, sensor.filters, target, draws)
    return stages


def start_localization(
    controller: Controller | LiveController,
    robot: Robot,
    readings: Array,
    pose: Target,
    draws: Draws,
) -> list[FilterStage]:
    """Start the stages between the true ``pose`` and the layers of the controller."""
    filters = {}
    stages: list[FilterStage] = []
    for index, (name, item) in enumerate(controller.localization.items()):
        if isinstance(item, protocol.Filter):
            filters[name] = item
            continue
        if index:
            raise InputError(
                f"controller.localization.{name}: must come first, because an estimator ignores "
                f"earlier filters; remove {', '.join(list(controller.localization)[:index])}, or "
                "put the estimator before them"
            )
        rule = start_rule(
            item.rule, ESTIMATOR_ARGUMENTS, item.start_estimate, robot, controller.period_s
        )
        stages = [FilterStage(1, *rule, draws(f"localization.{name}"), readings, pose.values)]
    return stages + _start_filters("localization", filters, pose, draws)


def describe_pose(pose: Array, period: float) -> Target:
    """Describe the ``pose`` (POSE_SIZE,), which the controller receives every ``period`` [s]."""
    unlimited = np.full(POSE_SIZE, np.inf)
    places = np.zeros((POSE_SIZE, 3))
    return Target(
        protocol.Channels(-unlimited, unlimited, places, period, signal=protocol.POSE), pose
    )


def _start_filters(
    part: str, filters: Mapping[str, protocol.Filter], target: Target, draws: Draws
) -> list[FilterStage]:
    always = np.zeros(target.channels.size)
    return [
        start_filter(item, target, always, draws(f"{part}.{name}"))
        for name, item in filters.items()
    ]


def start_filter(
    item: protocol.Filter, target: Target, onset: Array, rng: Generator
) -> FilterStage:
    """Start a filter that changes the values of a target after ``onset`` (channels,) [s]."""
    require(item, protocol.FILTER_RULES)
    rule = start_rule(item.rule, protocol.FILTER_ARGUMENTS, item.start, target.channels, onset, rng)
    return FilterStage(target.every, *rule, rng, NO_VALUES, target.values)


COMMAND_NAMES = "speed", "steering"
WHEEL_NAMES = "left wheel", "right wheel"


class Actuation:
    """The values between the ``command`` of the controller and the drive.

    Faults act first. A silent (NaN) command repeats the previous one; a silent wheel stops.
    """

    def __init__(self, command: Array) -> None:
        self._command, self._received = command, command.copy()
        self._sent, self._wanted = np.zeros(COMMAND_SIZE), np.zeros(COMMAND_SIZE)
        self._shares = np.ones(STRENGTH_SIZE)

    def list_targets(self, robot: Robot, period: float) -> list[Target]:
        """List the values that faults can change; the controller sets them every ``period`` [s]."""
        unlimited, places = np.full(COMMAND_SIZE, np.inf), np.zeros((COMMAND_SIZE, 3))
        stops = np.array([robot.drive.max_speed_mps, robot.drive.steering_limit])
        low, high, full = np.zeros(STRENGTH_SIZE), np.full(STRENGTH_SIZE, np.inf), np.ones(2)
        commands = -unlimited, unlimited, places, period, COMMAND_NAMES
        wheels = low, high, np.zeros((STRENGTH_SIZE, 3)), period, WHEEL_NAMES
        return [
            Target(protocol.Channels(*commands, protocol.COMMAND, stops), self._sent),
            Target(protocol.Channels(*commands, protocol.DRIVE, stops), self._wanted),
            Target(protocol.Channels(*wheels, protocol.STRENGTH, full), self._shares),
        ]

    def order(
        self, faults: Mapping[str, Sequence[FilterStage]], driven: Array, strength: Array
    ) -> list[FilterStage]:
        """Return the fault stages in order, with stages that copy values between signals."""
        stages = [_start_copy(copy_signal, self._command, driven)]
        if faults[protocol.COMMAND] or faults[protocol.DRIVE]:
            stages = [
                _start_copy(copy_signal, self._command, self._sent),
                *faults[protocol.COMMAND],
                _start_copy(_receive, self._sent, self._received),
                _start_copy(copy_signal, self._received, self._wanted),
                *faults[protocol.DRIVE],
                _start_copy(_receive, self._wanted, driven),
            ]
        if faults[protocol.STRENGTH]:
            full = np.ones(STRENGTH_SIZE)
            stages += [
                _start_copy(copy_signal, full, self._shares),
                *faults[protocol.STRENGTH],
                _start_copy(_weaken, self._shares, strength),
            ]
        return stages


def _start_copy(rule: object, source: Array, values: Array) -> FilterStage:
    return FilterStage(1, *bind(rule, SENSOR_ARGUMENTS, None), _NO_DRAWS, source, values)  # type: ignore[arg-type]


_NO_DRAWS: Generator = generator("", "copy")  # an unused argument: copies need no random numbers


def copy_signal(signal: Array, values: Array) -> None:
    """Copy the values computed by another stage."""
    copy_values(signal, values)


def _receive(signal: Array, values: Array) -> None:
    for i in range(len(values)):
        if not math.isnan(signal[i]):
            values[i] = signal[i]


def _weaken(signal: Array, values: Array) -> None:
    for i in range(len(values)):
        values[i] = 0.0 if math.isnan(signal[i]) else min(max(signal[i], 0.0), 1.0)
