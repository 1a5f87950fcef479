"""Starts the filters of a mission, between the sensors and the controller."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import NO_VALUES, POSE_SIZE, Array, copy_values
from evoros.base.errors import InputError
from evoros.compilation.named_rules import bind, start_part
from evoros.controller.protocol import ESTIMATOR_ARGUMENTS, Controller, LiveController
from evoros.failure.protocol import Fault
from evoros.failure.trigger import Trigger
from evoros.filter.protocol import EFFECTS, FILTER_ARGUMENTS, POSE, READINGS, Channels, Filter
from evoros.mission.fault_draws import Draws
from evoros.mission.inputs import FilterStage
from evoros.robot.model import Robot
from evoros.sensor.protocol import SENSOR_ARGUMENTS, is_signal_sensor

Clocks = Mapping[Trigger, int]
"""The places in ``Arrays.clocks`` of a robot's triggers."""


class _SensorType(NamedTuple):
    """The sensors of one type on a robot, which come one after another."""

    name: str
    first: int
    last: int  # the number after the last sensor's
    channels: Channels
    values: Array  # a view of their readings
    every: int  # ticks between two readings


def _list_types(robot: Robot, readings: Array, tick: float) -> Iterator[_SensorType]:
    names = [mount.sensor for mount in robot.mounts]
    for name in dict.fromkeys(names):
        first = names.index(name)
        last = first + names.count(name)
        channels = _describe_channels(robot, first, last)
        values = readings[robot.layout[first].start : robot.layout[last - 1].stop]
        yield _SensorType(name, first, last, channels, values, round(channels.period / tick))


def _describe_channels(robot: Robot, first: int, last: int) -> Channels:
    """Describe the channels of the sensors from ``first`` to before ``last``, of one type."""
    sensor, count = robot.mounted_sensors()[first], last - first
    channels = sensor.channels
    return Channels(
        low=np.array([channel.low for channel in channels] * count),
        high=np.array([channel.high for channel in channels] * count),
        position=np.repeat(robot.sensor_poses[first:last, :3], len(channels), axis=0),
        period=sensor.period_s,
        names=tuple(channel.name for channel in channels) * count,
    )


def start_sensor_filters(
    robot: Robot,
    faults: Sequence[Fault],
    signals: Array,
    readings: Array,
    tick: float,
    draws: Draws,
    clocks: Clocks | None = None,
) -> list[FilterStage]:
    """Start, for each sensor type, the publication of its readings, its filters and the faults.

    ``signals``, which a simulation senses, and ``readings`` (channels,) are arrays of the mission,
    whose clock has the period ``tick`` [s]. Each stage acts on the sensors of one type whenever
    they have new readings. A fault acts on all channels of a sensor from the same time on. Its
    draws depend on its index among the faults of its name, so faults of other names shift none.
    """
    stages: list[FilterStage] = []
    for kind in _list_types(robot, readings, tick):
        part, filters = f"sensor.{kind.name}", robot.sensors[kind.name].filters
        stages += _start_reading(robot, kind, signals, readings, draws(part))
        stages += _start_filters(part, filters, kind.channels, kind.values, kind.every, draws)
        stages += _start_faults(kind, faults, 0, draws, clocks or {})
    return stages


def start_later_faults(
    robot: Robot,
    faults: Sequence[Fault],
    begun: int,
    readings: Array,
    tick: float,
    draws: Draws,
    clocks: Clocks,
) -> list[FilterStage]:
    """Start the faults of sensors that come amid a mission, after the first ``begun`` of all."""
    stages: list[FilterStage] = []
    for kind in _list_types(robot, readings, tick):
        stages += _start_faults(kind, faults, begun, draws, clocks)
    return stages


def _start_faults(
    kind: _SensorType, faults: Sequence[Fault], begun: int, draws: Draws, clocks: Clocks
) -> Iterator[FilterStage]:
    """Start those faults after the first ``begun`` that act on sensors of this type."""
    counts: Counter[str] = Counter()
    repeats = kind.channels.size // (kind.last - kind.first)
    for index, fault in enumerate(faults):
        if fault.signal != READINGS:
            continue
        onset = np.repeat(fault.onset[kind.first : kind.last], repeats)
        number = counts[fault.name]
        counts[fault.name] += 1
        if index >= begun and np.isfinite(onset).any():
            rng = draws(f"fault.{fault.name}.{number}.{kind.name}")
            stage = start_filter(fault.filter, kind.channels, onset, rng, kind.values, kind.every)
            yield stage._replace(clock=clocks.get(fault.trigger, 0))


def _publish(signal: Array, values: Array) -> None:
    """Copy the true ranges to the readings; the rule of every type of range sensor."""
    copy_values(signal, values)


def _start_reading(
    robot: Robot, kind: _SensorType, signals: Array, readings: Array, rng: Generator
) -> list[FilterStage]:
    """Start the publication of the readings of the sensors of one type.

    Ranges are copied. From a signal, the rule of the sensor computes the readings of each mount.
    """
    _, first, last, _, values, every = kind
    sensor, parts = robot.mounted_sensors()[first], robot.signal_layout[first:last]
    if not is_signal_sensor(sensor):
        source = signals[parts[0].start : parts[-1].stop]
        return [FilterStage(every, *bind(_publish, SENSOR_ARGUMENTS, None), rng, source, values)]
    stages = []
    for part, place in zip(parts, robot.layout[first:last], strict=True):
        rule = bind(sensor.rule, SENSOR_ARGUMENTS, start_part(sensor.start))
        stages.append(FilterStage(every, *rule, rng, signals[part], readings[place]))
    return stages


def start_localization(
    controller: Controller | LiveController,
    robot: Robot,
    readings: Array,
    pose: Array,
    draws: Draws,
) -> list[FilterStage]:
    """Start the stages between the true ``pose`` (POSE_SIZE,) and the controller's layers.

    ``readings`` (channels,) are of all sensors of the robot.

    Raises:
        InputError: an estimator comes after something else, or the robot lacks its sensors.
    """
    channels, filters = describe_pose(controller.period_s), {}
    stages: list[FilterStage] = []
    for index, (name, item) in enumerate(controller.localization.items()):
        if isinstance(item, Filter):
            filters[name] = item
            continue
        if index:
            raise InputError(
                f"controller.localization.{name}: must be the first of its localization, because "
                f"it does not depend on what comes before; remove "
                f"{', '.join(list(controller.localization)[:index])}, or put it after"
            )
        started = start_part(item.start_estimate, robot, controller.period_s)
        rule, rng = bind(item.rule, ESTIMATOR_ARGUMENTS, started), draws(f"localization.{name}")
        stages = [FilterStage(1, *rule, rng, readings, pose)]
    return stages + _start_filters("localization", filters, channels, pose, 1, draws)


def describe_pose(period: float) -> Channels:
    """Describe the pose that a controller gets each ``period`` [s]."""
    unlimited = np.full(POSE_SIZE, np.inf)
    return Channels(-unlimited, unlimited, np.zeros((POSE_SIZE, 3)), period, signal=POSE)


def _start_filters(
    part: str,
    filters: Mapping[str, Filter],
    channels: Channels,
    values: Array,
    every: int,
    draws: Draws,
) -> list[FilterStage]:
    """Start the filters of a part, each with its random stream."""
    always = np.zeros(channels.size)
    return [
        start_filter(item, channels, always, draws(f"{part}.{name}"), values, every)
        for name, item in filters.items()
    ]


def start_filter(
    item: Filter, channels: Channels, onset: Array, rng: Generator, values: Array, every: int
) -> FilterStage:
    """Start a filter between a source and ``values``, for each ``every`` ticks.

    Raises:
        InputError: it is no filter, or refuses to start.
    """
    effect = getattr(item, "effect", None)  # a failure may draw anything
    if effect not in EFFECTS:
        raise InputError(
            f"{type(item).__name__}.effect: must be one of {', '.join(EFFECTS)}, not {effect!r}; "
            f"correct the class"
        )
    started = start_part(item.start, channels, onset, rng)
    rule = bind(item.rule, FILTER_ARGUMENTS, started)
    return FilterStage(every, *rule, rng, NO_VALUES, values)
