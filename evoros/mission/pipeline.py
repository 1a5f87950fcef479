"""The chains of filters of one mission: from what sensors measure to what the controller reads."""

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import POSE_SIZE, Array
from evoros.failure.protocol import Fault
from evoros.filter.protocol import Channels, Filter
from evoros.mission.loop import FilterStage, publish
from evoros.robot.model import Robot

Draws = Callable[[str], Generator]
"""The generator of a named part, in this mission."""


def sensor_channels(robot: Robot, first: int = 0, last: int | None = None) -> Channels:
    """What filters may know of the sensors from ``first`` to before ``last``; of all by default."""
    sensors = [robot.sensors[mount.sensor] for mount in robot.mounts[first:last]]
    return Channels(
        low=np.array([sensor.range_min_m for sensor in sensors]),
        high=np.array([sensor.range_max_m for sensor in sensors]),
        position=np.ascontiguousarray(robot.sensor_poses()[first:last, :3]),
        period=min((sensor.period_s for sensor in sensors), default=0.0),
    )


def sensor_chain(
    robot: Robot, faults: Sequence[Fault], raw: Array, readings: Array, tick: float, draws: Draws
) -> list[FilterStage]:
    """For each sensor type in turn: publish, its own filters, then the faults.

    ``raw`` and ``readings`` (sensors,) are the arrays of the mission [m]; ``tick`` [s] is its
    clock's. Each link works on the sensors of one type only, when these have a new reading.
    """
    names = [mount.sensor for mount in robot.mounts]
    chain: list[FilterStage] = []
    for name in dict.fromkeys(names):
        first = names.index(name)
        last = first + names.count(name)
        channels, values = sensor_channels(robot, first, last), readings[first:last]
        every, part = round(channels.period / tick), f"sensor.{name}"
        chain.append(FilterStage(every, publish, np.empty(0), raw[first:last], draws(part), values))
        chain += _started(part, robot.sensors[name].filters, channels, values, every, draws)
        for number, fault in _numbered(faults):
            onset = fault.onset[first:last]
            rng = draws(f"fault.{fault.name}.{number}.{name}")
            if np.isfinite(onset).any():
                started = fault.filter.start(channels, onset, rng)
                chain.append(FilterStage(every, fault.filter.rule, *started, rng, values))
    return chain


def _numbered(faults: Sequence[Fault]) -> Iterator[tuple[int, Fault]]:
    """Each fault with its number among those of its name: others do not shift its draws."""
    met: dict[str, int] = {}
    for fault in faults:
        met[fault.name] = met.get(fault.name, -1) + 1
        yield met[fault.name], fault


def localization_chain(
    filters: Mapping[str, Filter], pose: Array, period: float, draws: Draws
) -> list[FilterStage]:
    """What stands between the true ``pose`` (POSE_SIZE,) and the controller, at its period [s]."""
    boundless = np.full(POSE_SIZE, np.inf)
    channels = Channels(-boundless, boundless, np.zeros((POSE_SIZE, 3)), period)
    return _started("localization", filters, channels, pose, 1, draws)


def _started(
    part: str,
    filters: Mapping[str, Filter],
    channels: Channels,
    values: Array,
    every: int,
    draws: Draws,
) -> list[FilterStage]:
    """The filters started for one mission, each with a stream of its own."""
    chain = []
    for name, each in filters.items():
        rng = draws(f"{part}.{name}")
        started = each.start(channels, np.zeros(channels.size), rng)
        chain.append(FilterStage(every, each.rule, *started, rng, values))
    return chain
