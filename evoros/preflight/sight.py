"""Finds sensors that see the ground or their own robot, and sensors whose housings overlap."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, islice
from typing import NamedTuple, TypeVar

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array
from evoros.base.linear import product
from evoros.mission.member import Member
from evoros.preflight.subject import Subject, find_avoidance_range, try_designs
from evoros.robot.housings import Overlap, find_overlaps, list_housings
from evoros.robot.model import Robot
from evoros.robot.occlusion import Occluders
from evoros.robot.self_sight import SelfSight, find_self_sights
from evoros.sensor.protocol import Mount, sees
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import PlacedRobot
from evoros.world.course import Course
from evoros.world.floors import GROUND
from evoros.world.model import World

T = TypeVar("T")
_FAR_M = 1e4  # from the robot, where a course disturbs nothing
_AWAY = Course(_FAR_M, _FAR_M, 0.0, 0.0, [[2 * _FAR_M, _FAR_M]], 1.0, 1.0, "forward", True)


class GroundSight(NamedTuple):
    """A sensor that sees the ground within the range of the avoidance."""

    mount: Mount
    key: str  # of the avoidance range
    range_m: float  # within which the controller avoids
    reading_m: float
    height_m: float  # of the sensor above the ground
    drop_deg: float  # of its lowest ray, below the horizon


def check_sight(subject: Subject) -> Iterator[str]:
    """Yield a warning if sensors of the designs of ``try_designs`` see the ground."""
    sights = [list(_find_ground(member)) for member in try_designs(subject)]
    yield from _report_worst(sights, lambda sight: -sight.reading_m, _describe_ground)


def check_self_sight(subject: Subject) -> Iterator[str]:
    """Yield a warning if the robot hides from its sensors a part of their view.

    It tries the designs of ``try_designs``.
    """
    sights = [list(find_self_sights(member.robot)) for member in try_designs(subject)]
    yield from _report_worst(sights, _hidden_share, _describe_sight)


def _report_worst(
    sights: Sequence[Sequence[T]], badness: Callable[[T], float], describe: Callable[[T], str]
) -> Iterator[str]:
    """Yield a warning about the worst of the sights in several designs, if there is any."""
    worst = max(chain.from_iterable(sights), key=badness, default=None)
    if worst is not None:
        count = f"{sum(map(bool, sights))} of {len(sights)} designs that were tried"
        yield f"design: in {count}, {describe(worst)}"


def check_housings(subject: Subject) -> Iterator[str]:
    """Yield a warning if the housings of sensors overlap in every design that is drawn at random.

    Of designs that overlap by chance, a search has others to choose from.
    """
    # The first three have all sensors in the middle or at an end of their regions.
    members = islice(try_designs(subject), 3, None)
    overlaps = [list(find_overlaps(list_housings(member.robot))) for member in members]
    if overlaps and all(overlaps):
        yield (
            f"design: in each of {len(overlaps)} random designs, housings of sensors overlap, at "
            f"most {_describe_overlap(max(chain.from_iterable(overlaps)))}; missions allow it, but "
            f"such a robot cannot be built; make regions larger, or size_m of the sensors smaller"
        )


def check_designs(robots: Mapping[str, Robot]) -> Iterator[str]:
    """Yield a warning for each named robot whose sensors overlap or see it."""
    for name, robot in robots.items():
        overlaps = list(find_overlaps(list_housings(robot)))
        if overlaps:
            yield (
                f"{name}: housings of sensors overlap, at most {_describe_overlap(max(overlaps))}; "
                f"missions allow it, but such a robot cannot be built; move one of them"
            )
        sights = list(find_self_sights(robot))
        if sights:
            yield f"{name}: {_describe_sight(max(sights, key=_hidden_share))}"


def _describe_overlap(overlap: Overlap) -> str:
    return f"{overlap.first} and {overlap.second} by {1e3 * overlap.depth_m:.1f} mm"


def _hidden_share(sight: SelfSight) -> float:
    return sight.hidden_share


def _describe_sight(sight: SelfSight) -> str:
    mount = sight.mount
    return (
        f"the robot hides {100 * sight.hidden_share:.0f} % of the cone of a {mount.sensor} at x "
        f"{mount.x_m:.3g}, y {mount.y_m:.3g}, z {mount.z_m:.3g} m on {mount.link} with yaw "
        f"{mount.yaw_deg:.3g} deg, which sees {sight.link} {sight.distance_m:.3g} m away at some "
        f"steering angle; place it on the outline, facing outwards (OutlineRegion), or move it up"
    )


def _find_ground(member: Member) -> Iterator[GroundSight]:
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
            yield GroundSight(mount, key, limit, reading, float(frame[2, 3]), drop)


def _measure_ground(robot: Robot) -> Array:
    """Return the ranges [m] on empty ground, as if the robot hid nothing of it."""
    world = World("empty", (GROUND,), _AWAY, "preflight", "")
    signals = np.zeros(robot.signal_count)
    bare = PlacedRobot(replace(robot, occluders=Occluders()), _AWAY.home)
    with Planar().open([bare], world) as simulation:
        simulation.sense(signals)
    return signals[: robot.beam_count]


def _describe_ground(sight: GroundSight) -> str:
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
