"""Finds sensors that see the ground within the range of the avoidance."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.linear import product
from evoros.mission.member import Member
from evoros.preflight.layer_values import find_avoidance_range
from evoros.preflight.subject import Subject
from evoros.preflight.trial_designs import try_designs
from evoros.robot.model import Robot
from evoros.robot.occlusion import Occluders
from evoros.sensor.protocol import Mount, sees
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import PlacedRobot
from evoros.world.course import Course
from evoros.world.floors import GROUND
from evoros.world.model import World

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


def check_sight(subject: Subject) -> Iterator[str]:
    """Yield a warning if sensors see the ground.

    This tries designs in the middle, at both ends and at some other places of the search space.
    """
    members = list(try_designs(subject))
    sights = [list(_find_seen(member)) for member in members]
    worst = min((sight for seen in sights for sight in seen), key=_reading, default=None)
    if worst is not None:
        designs = f"in {sum(map(bool, sights))} of {len(members)} designs that were tried"
        yield f"design: {designs}, {_describe_ground(worst)}"


def _reading(sight: Sight) -> float:
    return sight.reading_m


def _find_seen(member: Member) -> Iterator[Sight]:
    """Yield each sensor that sees the ground within the range of the avoidance."""
    avoidance, robot = find_avoidance_range(member.controller), member.robot
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
    bare = PlacedRobot(replace(robot, occluders=Occluders()), _AWAY.home)
    with Planar().open([bare], world) as simulation:
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
