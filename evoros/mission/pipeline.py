"""Starts the filters of a mission, between what sensors measure and what the controller reads."""

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import NO_PARAMETERS, POSE_SIZE, Array
from evoros.controller.protocol import Controller, LiveController
from evoros.failure.protocol import Fault
from evoros.filter.protocol import Channels, Filter
from evoros.mission.loop import FilterStage, publish
from evoros.robot.model import Robot

Draws = Callable[[str], Generator]
"""Creates the generator of a named part in one mission."""


def describe_sensors(robot: Robot) -> Channels:
    """Describe the sensors to failures, as one value each, whatever they have of channels."""
    sensors = robot.mounted_sensors()
    return Channels(
        low=np.array([min(channel.low for channel in sensor.channels) for sensor in sensors]),
        high=np.array([max(channel.high for channel in sensor.channels) for sensor in sensors]),
        position=np.ascontiguousarray(robot.sensor_poses()[:, :3]),
        period=min((sensor.period_s for sensor in sensors), default=0.0),
    )


def _describe_channels(robot: Robot, first: int, last: int) -> Channels:
    """Describe the channels of the sensors from ``first`` to before ``last``, of one type."""
    sensor, count = robot.mounted_sensors()[first], last - first
    channels = sensor.channels
    return Channels(
        low=np.array([channel.low for channel in channels] * count),
        high=np.array([channel.high for channel in channels] * count),
        position=np.repeat(robot.sensor_poses()[first:last, :3], len(channels), axis=0),
        period=sensor.period_s,
    )


def start_sensor_filters(
    robot: Robot, faults: Sequence[Fault], ranges: Array, readings: Array, tick: float, draws: Draws
) -> list[FilterStage]:
    """Start, for each sensor type, the publication of its readings, its filters and the faults.

    ``ranges`` (beams,) [m] and ``readings`` (channels,) are arrays of the mission, and ``tick`` is
    that of its clock [s]. Each stage acts on the sensors of one type, whenever they have new
    readings. A fault acts on all channels of a sensor from the same time on.
    """
    names = [mount.sensor for mount in robot.mounts]
    stages: list[FilterStage] = []
    for name in dict.fromkeys(names):
        first = names.index(name)
        last = first + names.count(name)
        channels = _describe_channels(robot, first, last)
        values = readings[robot.layout[first].start : robot.layout[last - 1].stop]
        source = ranges[robot.beam_layout[first].start : robot.beam_layout[last - 1].stop]
        every, part = round(channels.period / tick), f"sensor.{name}"
        stages.append(FilterStage(every, publish, NO_PARAMETERS, source, draws(part), values))
        stages += _start_filters(part, robot.sensors[name].filters, channels, values, every, draws)
        for number, fault in _number_by_name(faults):
            onset = np.repeat(fault.onset[first:last], channels.size // (last - first))
            rng = draws(f"fault.{fault.name}.{number}.{name}")
            if np.isfinite(onset).any():
                arrays = fault.filter.start(channels, onset, rng)
                stages.append(FilterStage(every, fault.filter.rule, *arrays, rng, values))
    return stages


def _number_by_name(faults: Sequence[Fault]) -> Iterator[tuple[int, Fault]]:
    """Yield each fault with its number among those of its name, on which its draws depend.

    So a fault of another name does not change them.
    """
    numbers: dict[str, int] = {}
    for fault in faults:
        numbers[fault.name] = numbers.get(fault.name, -1) + 1
        yield numbers[fault.name], fault


def start_localization(
    controller: Controller | LiveController, pose: Array, draws: Draws
) -> list[FilterStage]:
    """Start the filters between the true ``pose`` (POSE_SIZE,) and the controller's layers."""
    unlimited = np.full(POSE_SIZE, np.inf)
    channels = Channels(-unlimited, unlimited, np.zeros((POSE_SIZE, 3)), controller.period_s)
    return _start_filters("localization", controller.localization, channels, pose, 1, draws)


def _start_filters(
    part: str,
    filters: Mapping[str, Filter],
    channels: Channels,
    values: Array,
    every: int,
    draws: Draws,
) -> list[FilterStage]:
    """Start the filters of a part, each with a random stream of its own."""
    stages = []
    for name, item in filters.items():
        rng = draws(f"{part}.{name}")
        arrays = item.start(channels, np.zeros(channels.size), rng)
        stages.append(FilterStage(every, item.rule, *arrays, rng, values))
    return stages
