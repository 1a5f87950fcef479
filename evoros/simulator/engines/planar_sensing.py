"""The rule by which robots in the plane see, over the arrays of ``planar_layout``.

It gives the same bits compiled and interpreted.
"""

import math
from typing import NamedTuple

from evoros.base.arrays import Array, Matrix
from evoros.base.compilable import compilable
from evoros.base.packing import unpack
from evoros.geometry.grid import cell_at
from evoros.geometry.ray import (
    AT_X,
    AT_Y,
    AT_Z,
    BOUND,
    BOX,
    KIND,
    cast_rays,
    is_beside,
    is_beyond,
    place_obstacle,
    turn_frame,
)
from evoros.simulator.engines.planar_beams import (
    END_BEAM,
    END_RAY,
    FIRST_BEAM,
    FIRST_RAY,
    FREE_RANGE,
    LEFT_EDGE,
    MIN_RANGE,
    ORIGIN,
    REACH,
    RIGHT_EDGE,
    SPACING,
    find_span,
)
from evoros.simulator.engines.planar_bodies import Movables, Placed, PlanarPose
from evoros.simulator.engines.planar_layout import (
    SHAPES,
    SIGNALS,
    STEERING_ANGLE,
    Memory,
    Plane,
    pose_of,
    sight_of,
)
from evoros.simulator.engines.planar_signals import fill_signals
from evoros.simulator.engines.steered_sight import see_parts_at

FULL_TURN = 2.0 * math.pi


class Sensors(NamedTuple):
    """The sensors of a robot at its pose."""

    beams: Matrix
    groups: Matrix
    rays: Matrix
    pose: PlanarPose


@compilable
def sense(parameters: Array, memory: Array, signals: Array) -> None:
    """Fill ``signals`` with the range [m] of each beam of all robots, within the sensor's limits.

    It is the distance to obstacles, bodies that can be pushed, other robots and steered wheels.
    """
    places = unpack(Plane, parameters).places
    place_shapes(parameters, memory)
    for i in range(len(places) - 1):
        see(parameters, memory, i, signals[int(places[i, SIGNALS]) :])


def sense_signals(parameters: Array, memory: Array, signals: Array) -> None:
    """Fill ``signals`` as ``sense`` does, and with those of all other sensors.

    It takes a sixth longer to compile than ``sense``, which suffices for most first runs.
    """
    sense(parameters, memory, signals)
    places = unpack(Plane, parameters).places
    for i in range(len(places) - 1):
        fill_signals(parameters, memory, i, signals[int(places[i, SIGNALS]) :])


@compilable
def place_shapes(parameters: Array, memory: Array) -> None:
    """Move the shapes of the robots to where these are."""
    plane, placed = unpack(Plane, parameters), unpack(Memory, memory).shapes
    for i in range(len(plane.drives)):
        x, y, cos, sin = pose_of(memory, i)
        for k in range(int(plane.places[i, SHAPES]), int(plane.places[i + 1, SHAPES])):
            place_obstacle(plane.shapes[k], x, y, cos, sin, placed[k])


@compilable
def see(parameters: Array, memory: Array, number: int, ranges: Array) -> None:
    """Fill in the range [m] of each beam of a robot."""
    plane, now, sight = (
        unpack(Plane, parameters),
        unpack(Memory, memory),
        sight_of(parameters, number),
    )
    beams = sight.beams
    for i in range(len(beams)):
        ranges[i] = beams[i, FREE_RANGE]
    if len(sight.steered) > 0:
        see_parts_at(sight.steered, now.motions[number, STEERING_ANGLE], ranges)
    pose = pose_of(memory, number)
    sensors = Sensors(beams, sight.groups, sight.rays, pose)
    cell = cell_at(sight.grid, pose[0], pose[1])
    if cell >= 0:
        for entry in range(int(sight.starts[cell]), int(sight.starts[cell + 1])):
            detect(sight.obstacles[int(sight.entries[entry])], sight.faces, sensors, ranges)
    faces = unpack(Movables, plane.movables).faces
    detect_all(unpack(Placed, now.movables).sights, faces, sensors, ranges)
    for other in range(len(now.motions)):
        if other != number:
            start, end = int(plane.places[other, SHAPES]), int(plane.places[other + 1, SHAPES])
            detect_all(now.shapes[start:end], plane.faces, sensors, ranges)
    for i in range(len(beams)):
        if ranges[i] < beams[i, MIN_RANGE]:
            ranges[i] = beams[i, MIN_RANGE]


@compilable
def detect_all(obstacles: Array, faces: Array, sensors: Sensors, ranges: Array) -> None:
    """Lower each range [m] whose beam sees one of the obstacles at a shorter range."""
    for i in range(len(obstacles)):
        detect(obstacles[i], faces, sensors, ranges)


@compilable
def detect(obstacle: Array, faces: Array, sensors: Sensors, ranges: Array) -> None:
    """Lower each range [m] whose beam sees the obstacle at a shorter range."""
    x, y, cos, sin = sensors.pose
    dx = obstacle[AT_X] - x
    dy = obstacle[AT_Y] - y
    centre = cos * dx + sin * dy, cos * dy - sin * dx
    for g in range(len(sensors.groups)):
        if sensors.groups[g, SPACING] == 0.0:
            cast_beams(obstacle, faces, sensors, g, centre, ranges)
        else:
            cast_group(obstacle, faces, sensors, g, centre, ranges)


@compilable
def cast_group(
    obstacle: Array,
    faces: Array,
    sensors: Sensors,
    number: int,
    centre: tuple[float, float],
    ranges: Array,
) -> None:
    """Lower the ranges of an even group's beams, as ``detect`` does.

    ``centre`` [m] is the obstacle's in the robot's frame.
    """
    group = sensors.groups[number]
    first_beam = int(group[FIRST_BEAM])
    origin = sensors.beams[first_beam]
    px = centre[0] - origin[ORIGIN]
    py = centre[1] - origin[ORIGIN + 1]
    reach = group[REACH] + obstacle[BOUND]
    if px * px + py * py >= reach * reach:
        return
    pz = obstacle[AT_Z] - origin[ORIGIN + 2]
    _, _, cos, sin = sensors.pose
    ray = int(origin[FIRST_RAY])
    low, high = find_span(group, px, py, obstacle[BOUND])
    count = int(group[END_BEAM]) - first_beam
    turn = FULL_TURN / group[SPACING]
    for k in range(-1, 2):
        start = max(int(low + k * turn), 0)
        end = min(int(high + k * turn) + 1, count)
        if start < end:
            cast_rays(
                obstacle, faces, turn_frame(obstacle, cos, sin), -px, -py, -pz,
                sensors.rays, ray + start, ray + end, math.inf, ranges, first_beam + start,
            )  # fmt: skip


@compilable
def cast_beams(
    obstacle: Array,
    faces: Array,
    sensors: Sensors,
    group: int,
    centre: tuple[float, float],
    ranges: Array,
) -> None:
    """Lower the ranges of the beams of a group that is not even, as ``cast_group`` does."""
    beams = sensors.beams
    _, _, cos, sin = sensors.pose
    bound = obstacle[BOUND]
    for i in range(int(sensors.groups[group, FIRST_BEAM]), int(sensors.groups[group, END_BEAM])):
        px = centre[0] - beams[i, ORIGIN]
        py = centre[1] - beams[i, ORIGIN + 1]
        # Skip the rays if the circle around the obstacle is too far away or beside the beam.
        far = ranges[i] + bound
        if px * px + py * py >= far * far:
            continue
        if px * beams[i, LEFT_EDGE] + py * beams[i, LEFT_EDGE + 1] > bound:
            continue
        if px * beams[i, RIGHT_EDGE] + py * beams[i, RIGHT_EDGE + 1] > bound:
            continue
        pz = obstacle[AT_Z] - beams[i, ORIGIN + 2]
        frame = turn_frame(obstacle, cos, sin)
        if obstacle[KIND] == BOX and (
            is_beside(obstacle, frame, px, py, beams[i, LEFT_EDGE], beams[i, LEFT_EDGE + 1])
            or is_beside(obstacle, frame, px, py, beams[i, RIGHT_EDGE], beams[i, RIGHT_EDGE + 1])
            or is_beyond(obstacle, frame, px, py, pz, ranges[i])
        ):
            continue
        first = int(beams[i, FIRST_RAY])
        end = int(beams[i, END_RAY])
        ranges[i] = cast_rays(
            obstacle, faces, frame, -px, -py, -pz, sensors.rays, first, end, ranges[i], ranges, -1
        )
