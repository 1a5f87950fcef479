"""Checks what sensors see (ground, robot, narrow obstacles), and overlaps of housings."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, islice
from operator import attrgetter
from typing import NamedTuple, TypeVar

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import Array, product
from evoros.base.errors import write_count
from evoros.compilation.elementary_arrays import atan2_all
from evoros.filter.mask import Mask
from evoros.geometry.footprint import Footprint, bounding_circle
from evoros.mission.member import Member
from evoros.preflight.scene import Subject, choose_middle, find_avoidance_range, try_designs
from evoros.robot.housings import Overlap, find_overlaps, list_housings
from evoros.robot.model import Robot
from evoros.robot.outline import Occluders
from evoros.robot.self_sight import SelfSight, find_seeing_beams, find_self_sights, list_spans
from evoros.sensor.protocol import Mount, RangeSensor, find_field, sees
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import PlacedRobot
from evoros.world.course import Course
from evoros.world.floors import GROUND
from evoros.world.model import World
from evoros.world.standing import list_areas

T = TypeVar("T")
_FAR_M = 1e4  # distance [m] from the robot at which the course cannot affect readings
NEAR_M = 1.0  # distance [m] at which obstacles should be visible if no avoidance range is set
SEEN_SHARE = 1 / 3  # minimum fraction of readings that must hit the narrowest obstacle
_AWAY = Course(_FAR_M, _FAR_M, 0.0, 0.0, [[2 * _FAR_M, _FAR_M]], 1.0, 1.0, "forward", True)


class GroundSight(NamedTuple):
    """A sensor that sees the ground within the avoidance range."""

    mount: Mount
    key: str  # key of the avoidance range
    range_m: float  # avoidance range
    reading_m: float
    height_m: float  # height of the sensor
    drop_deg: float  # angle from the horizon down to the lowest ray


def check_sight(subject: Subject) -> Iterator[str]:
    """Yield a warning if sensors of some designs see the ground."""
    sights = [list(_find_ground(member)) for member in try_designs(subject)]
    yield from _report_worst(sights, lambda sight: -sight.reading_m, _describe_ground)


def check_self_sight(subject: Subject) -> Iterator[str]:
    """Yield a warning if the robot blocks the view of sensors in some designs."""
    robots = [member.robot for member in try_designs(subject)]
    sights = [
        [s for s in find_self_sights(robot) if not _is_masked(robot, s.mount)] for robot in robots
    ]
    yield from _report_worst(sights, attrgetter("hidden_share"), _describe_sight)
    yield from _propose_masks(robots)


def _is_masked(robot: Robot, mount: Mount) -> bool:
    return any(isinstance(part, Mask) for part in robot.sensors[mount.sensor].filters.values())


def _propose_masks(robots: Sequence[Robot]) -> Iterator[str]:
    """Propose a mask for each scanner type of which the same beams hit the robot in all designs."""
    types: dict[str, set[tuple[int, str]]] = {}
    for robot in robots:
        for mount, seeing in zip(robot.mounts, find_seeing_beams(robot), strict=True):
            if len(seeing) > 1 and not _is_masked(robot, mount):
                spans = ",".join(f"[{first},{last}]" for first, last in list_spans(seeing))
                types.setdefault(mount.sensor, set()).add((len(seeing), spans))
    for name, masks in types.items():
        (scan, spans), *others = masks
        if spans and not others:
            mask = f"{{_target_:evoros.filter.mask.Mask,scan:{scan},beams:[{spans}]}}"
            yield (
                f"design.sensors.{name}: some of its {scan} beams see the robot itself, so the "
                "robot would avoid itself; to mask these beams, type "
                f"'+design.sensors.{name}.filters.own_body={mask}'"
            )


def check_gaps(subject: Subject) -> Iterator[str]:
    """Yield a warning for each sensor type whose rays can miss the narrowest obstacle."""
    worlds, height = subject.scenario.world.values(), subject.member.robot.height_m
    width, body = min(chain.from_iterable(_list_widths(w, height) for w in worlds), default=(0, ""))
    key, limit = find_avoidance_range(subject.member.controller) or ("", NEAR_M)
    (member,) = subject.scenario.equip(choose_middle(subject.space))
    sensors = {mount.sensor: member.robot.sensors[mount.sensor] for mount in member.robot.mounts}
    for name, sensor in sensors.items() if body else ():
        if not sees(sensor) or (gap := _measure_gap(sensor)) == 0.0:
            continue
        near, nearer = min(limit, sensor.range_max_m), width / gap
        if nearer < SEEN_SHARE * near:
            lower = f", or lower {key} to {nearer:.2g}" if key else ""
            yield (
                f"design.sensors.{name}: at {near:g} m, the rays are {near * gap:.2g} m apart and "
                f"can miss {body!r}, which is {width:.2g} m wide and reliably seen only within "
                f"{nearer:.2g} m; {_propose_rays(name, sensor, width / near)}{lower}"
            )


def _list_widths(world: World, height: float) -> Iterator[tuple[float, str]]:
    """Yield an upper bound on the width [m] of each low obstacle, and the name of its body."""
    for body, areas in list_areas(world, height):
        if any(shape.kind == "convex" for shape in body.shapes):
            areas = (Footprint(np.concatenate([area.vertices for area in areas])),)
        yield from ((2.0 * bounding_circle(area)[2], body.name) for area in areas)


def _measure_gap(sensor: RangeSensor) -> float:
    rays = np.asarray(sensor.rays())
    azimuths = np.unique(atan2_all(rays[:, 1], rays[:, 0]))
    return float(np.diff(azimuths).max(initial=0.0))


def _propose_rays(name: str, sensor: RangeSensor, gap: float) -> str:
    """Return the override that makes neighbouring rays at most ``gap`` [rad] apart."""
    low, high = find_field(sensor)
    spaces = round((high - low) / _measure_gap(sensor))
    zones = getattr(sensor, "zones", 1)
    for key in ("rays_per_axis", "rays_per_zone", "beams"):
        if hasattr(sensor, key):
            edges = zones * getattr(sensor, key) - spaces  # 1 if the outermost rays are on edges
            count = math.ceil((math.ceil((high - low) / gap) + edges) / zones)
            return f"set design.sensors.{name}.{key}={count}"
    return "choose a sensor with more rays"


def _report_worst(
    sights: Sequence[Sequence[T]], badness: Callable[[T], float], describe: Callable[[T], str]
) -> Iterator[str]:
    worst = max(chain.from_iterable(sights), key=badness, default=None)
    if worst is not None:
        count = f"{sum(map(bool, sights))} of {len(sights)} designs that were tried"
        yield f"design: in {count}, {describe(worst)}"


def check_housings(subject: Subject) -> Iterator[str]:
    """Yield a warning if sensor housings overlap in every random design."""
    # The first three designs put all sensors at the middle or at one end of their regions.
    members = islice(try_designs(subject), 3, None)
    overlaps = [list(find_overlaps(list_housings(member.robot))) for member in members]
    if overlaps and all(overlaps):
        yield (
            f"design: sensor housings overlap in all {len(overlaps)} random designs, by up to "
            f"{_describe_overlap(max(chain.from_iterable(overlaps)))}; simulation allows this, but "
            f"the robots could not be built; enlarge the regions, or reduce size_m of the sensors"
        )


def check_designs(robots: Mapping[str, Robot]) -> Iterator[str]:
    """Yield a warning if sensors of the named robots overlap, and one if they see the robot."""
    overlaps = {name: list(find_overlaps(list_housings(robot))) for name, robot in robots.items()}
    for names, overlap in _find_worst(overlaps, attrgetter("depth_m")):
        yield (
            f"{names}: sensor housings overlap, by up to {_describe_overlap(overlap)}; simulation "
            "allows this, but the robot could not be built; move one sensor"
        )
    sights = {name: list(find_self_sights(robot)) for name, robot in robots.items()}
    for names, sight in _find_worst(sights, attrgetter("hidden_share")):
        yield f"{names}: {_describe_sight(sight)}"


def _find_worst(
    found: Mapping[str, Sequence[T]], badness: Callable[[T], float]
) -> Iterator[tuple[str, T]]:
    """Yield the worst item, if any, with the robot's name and the number of other robots."""
    worst = {name: max(items, key=badness) for name, items in found.items() if items}
    if worst:
        name = max(worst, key=lambda name: badness(worst[name]))
        others = f" and {write_count(len(worst) - 1, 'other')}" if len(worst) > 1 else ""
        yield f"{name}{others}", worst[name]


def _describe_overlap(overlap: Overlap) -> str:
    return f"{1e3 * overlap.depth_m:.1f} mm ({overlap.first} and {overlap.second})"


def _describe_sight(sight: SelfSight) -> str:
    mount = sight.mount
    return (
        f"the robot blocks {100 * sight.hidden_share:.0f} % of the field of view of a "
        f"{mount.sensor} at x {mount.x_m:.3g}, y {mount.y_m:.3g}, z {mount.z_m:.3g} m on "
        f"{mount.link} with yaw {mount.yaw_deg:.3g} deg; at some steering angle, the sensor sees "
        f"{sight.link} {sight.distance_m:.3g} m away; place the sensor on the outline "
        "(OutlineRegion), facing outwards with a narrower yaw_deg or fov_deg, or move it up"
    )


def _find_ground(member: Member) -> Iterator[GroundSight]:
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
    """Measure the ranges [m] on empty ground as if the robot were transparent."""
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
        f"{sight.key} ({sight.range_m:g} m), so the robot keeps trying to avoid the ground; "
        f"raise the pitch to at least {pitch} deg (robot.mount.pitch_deg, or pitch_deg of the "
        "region), or lower that range"
    )
