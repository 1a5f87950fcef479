"""Finds sensors that see the ground within the range of the avoidance."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array, X, Y
from evoros.base.errors import InputError
from evoros.base.linear import product
from evoros.base.rng import generator
from evoros.evolution.experiment import Experiment
from evoros.evolution.layer_values import find_avoidance_range
from evoros.mission.scenario import Scenario
from evoros.robot.model import Robot
from evoros.robot.occlusion import Occluders
from evoros.sensor.protocol import Mount, sees
from evoros.simulator.planar import Planar
from evoros.world.course import Course
from evoros.world.floors import GROUND
from evoros.world.model import World

RANDOM_DESIGNS = 5
_FAR_M = 1e4  # from the robot, where a course disturbs nothing
_AWAY = Course(_FAR_M, _FAR_M, 0.0, 0.0, [[2 * _FAR_M, _FAR_M]], 1.0, 1.0, "forward", True)


class Sight(NamedTuple):
    """What a sensor of a design sees without obstacles."""

    mount: Mount
    key: str  # of the avoidance range
    range_m: float  # within which the controller avoids
    reading_m: float
    height_m: float  # of the sensor above the ground
    drop_deg: float  # of its lowest ray, below the horizon


def check_sight(experiment: Experiment) -> Iterator[str]:
    """Yield a warning if sensors see the ground.

    This tries designs in the middle, at both ends and at some other places of the search space.
    """
    scenarios = list(try_designs(experiment))
    sights = [list(_find_seen(scenario)) for scenario in scenarios]
    worst = min((sight for seen in sights for sight in seen), key=_reading, default=None)
    if worst is not None:
        designs = f"in {sum(map(bool, sights))} of {len(scenarios)} designs that were tried"
        yield f"design: {designs}, {_describe_ground(worst)}"


def _reading(sight: Sight) -> float:
    return sight.reading_m


def try_designs(experiment: Experiment) -> Iterator[Scenario]:
    """Yield the scenario with designs from the middle, both ends and the inside of the space."""
    space, rng = experiment.space, generator("preflight", "designs")
    genomes = [np.full(space.size, share) for share in (0.5, 0.0, 1.0)]
    for genome in (*genomes, *rng.random((RANDOM_DESIGNS, space.size))):
        try:
            yield experiment.scenario.with_design(space.decode(genome))
        except InputError:
            continue  # a part refuses this design, which is then an outcome of its missions


def _find_seen(scenario: Scenario) -> Iterator[Sight]:
    """Yield each sensor that sees the ground within the range of the avoidance."""
    avoidance, robot = find_avoidance_range(scenario.controller), scenario.robot
    if avoidance is None or not robot.mounts:
        return
    key, limit = avoidance
    ranges = _measure_ground(robot)
    frames = robot.sensor_frames
    for mount, beams, frame in zip(robot.mounts, robot.beam_layout, frames, strict=True):
        sensor = robot.sensors[mount.sensor]
        if not sees(sensor):
            continue
        reading = float(ranges[beams].min())
        if reading < min(limit, sensor.range_max_m):
            lowest = float((product(sensor.rays(), frame[:3, :3].T))[:, 2].min())
            drop = math.degrees(elementary.asin(-lowest))
            yield Sight(mount, key, limit, reading, float(frame[2, 3]), drop)


def _measure_ground(robot: Robot) -> Array:
    """Return the ranges [m] on empty ground, as if the robot hid nothing of it."""
    world = World("empty", (GROUND,), _AWAY, "preflight", "")
    signals = np.zeros(robot.signal_count)
    with Planar().open(replace(robot, occluders=Occluders()), world) as simulation:
        simulation.memory[[X, Y]] = 0.0
        simulation.sense(signals)
    return signals[: robot.beam_count]


def _describe_ground(sight: Sight) -> str:
    mount = sight.mount
    level = math.degrees(elementary.asin(min(1.0, sight.height_m / sight.range_m)))
    pitch = math.ceil(mount.pitch_deg + sight.drop_deg - level)
    return (
        f"a {mount.sensor} {sight.height_m:.3g} m above the ground with pitch "
        f"{mount.pitch_deg:g} deg sees the ground {sight.reading_m:.3g} m away, within "
        f"{sight.key} ({sight.range_m:g} m), so that the robot avoids it all the time; "
        f"raise the pitch to {pitch} deg or more (robot.mount.pitch_deg, or pitch_deg of "
        f"the region), or lower that range"
    )
