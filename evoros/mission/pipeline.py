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


def describe_sensors(robot: Robot, first: int = 0, last: int | None = None) -> Channels:
    """Describe the sensors from ``first`` to before ``last`` to filters; all by default."""
    sensors = [robot.sensors[mount.sensor] for mount in robot.mounts[first:last]]
    return Channels(
        low=np.array([sensor.range_min_m for sensor in sensors]),
        high=np.array([sensor.range_max_m for sensor in sensors]),
        position=np.ascontiguousarray(robot.sensor_poses()[first:last, :3]),
        period=min((sensor.period_s for sensor in sensors), default=0.0),
    )


def start_sensor_filters(
    robot: Robot, faults: Sequence[Fault], raw: Array, readings: Array, tick: float, draws: Draws
) -> list[FilterStage]:
    """Start, for each sensor type, the publication of its readings, its filters and the faults.

    ``raw`` and ``readings`` (sensors,) are arrays of the mission [m], and ``tick`` is that of its
    clock [s]. Each stage acts on the sensors of one type, whenever they have new readings.
    """
    names = [mount.sensor for mount in robot.mounts]
    stages: list[FilterStage] = []
    for name in dict.fromkeys(names):
        first = names.index(name)
        last = first + names.count(name)
        channels, values = describe_sensors(robot, first, last), readings[first:last]
        every, part = round(channels.period / tick), f"sensor.{name}"
        source = raw[first:last]
        stages.append(FilterStage(every, publish, NO_PARAMETERS, source, draws(part), values))
        stages += _start_filters(part, robot.sensors[name].filters, channels, values, every, draws)
        for number, fault in _number_by_name(faults):
            onset = fault.onset[first:last]
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
