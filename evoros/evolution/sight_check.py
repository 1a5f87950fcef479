"""Finds sensors that see the ground, or the robot itself, within the range of the avoidance."""

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
from evoros.geometry.shapes import Body, Pose
from evoros.mission.scenario import Scenario
from evoros.robot.model import Robot
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
    """Yield a warning for the ground and one for the robot if sensors see them.

    This tries designs in the middle, at both ends and at some other places of the search space.
    """
    scenarios = list(_try_designs(experiment))
    for bodies, describe in ((False, _describe_ground), (True, _describe_robot)):
        seen = [list(_find_seen(scenario, bodies)) for scenario in scenarios]
        worst = min((sight for each in seen for sight in each), key=_reading, default=None)
        if worst is not None:
            designs = f"in {sum(map(bool, seen))} of {len(scenarios)} designs that were tried"
            yield f"design: {designs}, {describe(worst)}"


def _reading(sight: Sight) -> float:
    return sight.reading_m


def _try_designs(experiment: Experiment) -> Iterator[Scenario]:
    space, rng = experiment.space, generator("preflight", "designs")
    genomes = [np.full(space.size, share) for share in (0.5, 0.0, 1.0)]
    for genome in (*genomes, *rng.random((RANDOM_DESIGNS, space.size))):
        try:
            yield experiment.scenario.with_design(space.decode(genome))
        except InputError:
            continue  # a part refuses this design, which is then an outcome of its missions


def _find_seen(scenario: Scenario, itself: bool) -> Iterator[Sight]:
    """Yield each sensor that sees the ground, or the robot ``itself``, within the range."""
    found, robot = find_avoidance_range(scenario.controller), scenario.robot
    if found is None or not robot.mounts:
        return
    key, limit = found
    ranges = _read(robot, itself)
    if itself:
        ranges = np.where(ranges < _read(robot, False), ranges, np.inf)
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


def _read(robot: Robot, itself: bool) -> Array:
    """Return the ranges [m] on empty ground; to the robot's own shapes too if ``itself``."""
    bodies = [
        Body(f"shape {i}", Pose(), (replace(solid.shape, pose=solid.pose),))
        for i, solid in enumerate(robot.solids if itself else ())
    ]
    world = World("empty", (GROUND, *bodies), _AWAY, "preflight", "")
    signals = np.zeros(robot.signal_count)
    with Planar().open(robot, world) as simulation:
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


def _describe_robot(sight: Sight) -> str:
    mount = sight.mount
    return (
        f"a {mount.sensor} at x {mount.x_m:.3g}, y {mount.y_m:.3g}, z {mount.z_m:.3g} m on "
        f"{mount.link} with yaw {mount.yaw_deg:.3g} deg would see the robot itself "
        f"{sight.reading_m:.3g} m away, which simulators leave out; place its region on the "
        f"outline, facing outwards (OutlineRegion), or move it up"
    )
