"""The filters and faults between sensors, controllers and drives in a mission."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import COMMAND_SIZE, NO_VALUES, POSE_SIZE, STRENGTH_SIZE, Array, copy_values
from evoros.base.checks import require
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.compilation.named_rules import bind, start_part
from evoros.controller.protocol import ESTIMATOR_ARGUMENTS, Controller, LiveController
from evoros.failure.protocol import NEVER, Fault, Trigger
from evoros.filter import protocol
from evoros.mission.inputs import FilterStage
from evoros.mission.participant import Draws
from evoros.robot.model import Robot
from evoros.sensor.protocol import SENSOR_ARGUMENTS, is_signal_sensor

Clocks = Mapping[Trigger, int]  # indices in ``Arrays.clocks`` of a robot's triggers


class Target(NamedTuple):
    """Values that faults can affect, such as the pose or the readings of one sensor type."""

    channels: protocol.Channels
    values: Array
    every: int = 1  # ticks between two samples
    name: str = ""  # name of the sensor type; empty: another part
    sensors: slice = slice(0)  # indices of the type's sensors, which are consecutive

    def spread(self, fault: Fault) -> Array:
        """Return the onset (channels,) of a fault; all channels of a sensor fail together."""
        if self.name:
            onset = fault.onset[self.sensors]
            return np.repeat(onset, self.channels.size // len(onset))
        spread = np.full(self.channels.size, NEVER)
        spread[list(fault.values) or slice(None)] = fault.onset[0]
        return spread


def start_faults(
    faults: Sequence[Fault], target: Target, draws: Draws, clocks: Clocks
) -> list[FilterStage]:
    """Start the faults that act on a target.

    Each fault has a random stream, so that faults of other names and signals do not change it.
    """
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
    """List a robot's sensor types with their part of its ``readings`` (channels,).

    The mission's clock has the period ``tick`` [s].
    """
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
    """Describe the channels of consecutive sensors of one type."""
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
    """Start the readings and the filters of each sensor type.

    ``signals`` is the simulation's output for the robot's sensors. Each stage acts on the sensors
    of one type when they have new readings.
    """
    stages: list[FilterStage] = []
    for target in targets:
        part = f"sensor.{target.name}"
        stages += _start_reading(robot, target, signals, draws(part))
        stages += _start_filters(part, robot.sensors[target.name].filters, target, draws)
    return stages


def _start_reading(
    robot: Robot, target: Target, signals: Array, rng: Generator
) -> list[FilterStage]:
    """Start the readings of one sensor type: ranges are copied, others computed from signals."""
    every, values = target.every, target.values
    sensor, parts = robot.sensors[target.name], robot.signal_layout[target.sensors]
    if not is_signal_sensor(sensor):
        source = signals[parts[0].start : parts[-1].stop]
        return [FilterStage(every, *bind(_copy, SENSOR_ARGUMENTS, None), rng, source, values)]
    stages = []
    for part, own in zip(parts, np.split(values, len(parts)), strict=True):
        rule = bind(sensor.rule, SENSOR_ARGUMENTS, start_part(sensor.start))
        stages.append(FilterStage(every, *rule, rng, signals[part], own))
    return stages


def start_localization(
    controller: Controller | LiveController,
    robot: Robot,
    readings: Array,
    pose: Target,
    draws: Draws,
) -> list[FilterStage]:
    """Start the stages between the true ``pose`` and the controller's layers.

    ``readings`` (channels,) belong to all sensors of the robot.

    Raises:
        InputError: an estimator is not the first, or the robot lacks its sensors.
    """
    filters = {}
    stages: list[FilterStage] = []
    for index, (name, item) in enumerate(controller.localization.items()):
        if isinstance(item, protocol.Filter):
            filters[name] = item
            continue
        if index:
            raise InputError(
                f"controller.localization.{name}: must be the first of its localization, because "
                f"it ignores earlier ones; remove "
                f"{', '.join(list(controller.localization)[:index])}, or put it after"
            )
        started = start_part(item.start_estimate, robot, controller.period_s)
        rule, rng = bind(item.rule, ESTIMATOR_ARGUMENTS, started), draws(f"localization.{name}")
        stages = [FilterStage(1, *rule, rng, readings, pose.values)]
    return stages + _start_filters("localization", filters, pose, draws)


def describe_pose(pose: Array, period: float) -> Target:
    """Describe the ``pose`` (POSE_SIZE,) that a controller gets every ``period`` [s]."""
    unlimited = np.full(POSE_SIZE, np.inf)
    places = np.zeros((POSE_SIZE, 3))
    return Target(
        protocol.Channels(-unlimited, unlimited, places, period, signal=protocol.POSE), pose
    )


def _start_filters(
    part: str, filters: Mapping[str, protocol.Filter], target: Target, draws: Draws
) -> list[FilterStage]:
    """Start the filters of a part, each with a random stream."""
    always = np.zeros(target.channels.size)
    return [
        start_filter(item, target, always, draws(f"{part}.{name}"))
        for name, item in filters.items()
    ]


def start_filter(
    item: protocol.Filter, target: Target, onset: Array, rng: Generator
) -> FilterStage:
    """Start a filter that changes the values of a target after ``onset`` (channels,) [s].

    Raises:
        InputError: ``item`` is not a filter, or refuses to start.
    """
    require(item, protocol.FILTER_RULES)  # a failure may draw anything
    started = start_part(item.start, target.channels, onset, rng)
    rule = bind(item.rule, protocol.FILTER_ARGUMENTS, started)
    return FilterStage(target.every, *rule, rng, NO_VALUES, target.values)


COMMAND_NAMES = "speed", "steering"
WHEEL_NAMES = "left wheel", "right wheel"


def spoils(faults: Sequence[Fault], *signals: str) -> bool:
    """Return True if any of the faults changes one of the signals."""
    return any(fault.signal in signals for fault in faults)


class Actuation:
    """The values between the ``command`` of a robot's controller and its drive.

    Command faults act before drive faults. A silent (NaN) command keeps the previous one in force,
    and a wheel of silent strength stops.
    """

    def __init__(self, command: Array) -> None:
        self._command, self._received = command, command.copy()
        self._sent, self._wanted = np.zeros(COMMAND_SIZE), np.zeros(COMMAND_SIZE)
        self._shares = np.ones(STRENGTH_SIZE)

    def list_targets(self, robot: Robot, period: float) -> list[Target]:
        """List the values that faults can affect, which change every ``period`` [s]."""
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
        """Return the stages of faults in order, and the copies between them.

        ``driven`` (COMMAND_SIZE,) is the drive's input, and ``strength`` its wheels' if any fail.
        """
        stages = [_start_copy(_copy, self._command, driven)]
        if faults[protocol.COMMAND] or faults[protocol.DRIVE]:
            stages = [
                _start_copy(_copy, self._command, self._sent),
                *faults[protocol.COMMAND],
                _start_copy(_receive, self._sent, self._received),
                _start_copy(_copy, self._received, self._wanted),
                *faults[protocol.DRIVE],
                _start_copy(_receive, self._wanted, driven),
            ]
        if faults[protocol.STRENGTH]:
            full = np.ones(STRENGTH_SIZE)
            stages += [
                _start_copy(_copy, full, self._shares),
                *faults[protocol.STRENGTH],
                _start_copy(_weaken, self._shares, strength),
            ]
        return stages


def _start_copy(rule: object, source: Array, values: Array) -> FilterStage:
    return FilterStage(1, *bind(rule, SENSOR_ARGUMENTS, None), _NO_DRAWS, source, values)  # type: ignore[arg-type]


_NO_DRAWS: Generator = generator("", "copy")  # copies draw no numbers


def _copy(signal: Array, values: Array) -> None:
    """Copy all values; also the rule of range sensors."""
    copy_values(signal, values)


def _receive(signal: Array, values: Array) -> None:
    """Copy the values that are not NaN."""
    for i in range(len(values)):
        if not math.isnan(signal[i]):
            values[i] = signal[i]


def _weaken(signal: Array, values: Array) -> None:
    """Clip the values to [0, 1]; NaN becomes 0."""
    for i in range(len(values)):
        values[i] = 0.0 if math.isnan(signal[i]) else min(max(signal[i], 0.0), 1.0)
