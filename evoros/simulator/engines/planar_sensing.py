"""The rule by which robots in the plane see, over the arrays of ``planar_layout``.

It gives the same bits compiled and interpreted.
"""

import math
from typing import NamedTuple

from evoros.base.arrays import Array, Matrix
from evoros.base.compilable import compilable
from evoros.base.packing import unpack
from evoros.geometry import ray
from evoros.geometry.grid import cell_at
from evoros.geometry.ray import Point, cast_rays, is_beside, is_beyond, place_obstacle, turn_frame
from evoros.simulator.engines import planar_beams as beam
from evoros.simulator.engines import planar_layout as layout
from evoros.simulator.engines.planar_bodies import Movables, Placed, PlanarPose
from evoros.simulator.engines.planar_layout import Memory, Plane, pose_of, sight_of
from evoros.simulator.engines.planar_signals import fill_signals
from evoros.simulator.engines.steered_sight import see_parts_at


class Sensors(NamedTuple):
    """The sensors of a robot at its pose."""

    beams: Matrix
    groups: Matrix
    rays: Matrix
    pose: PlanarPose
    ranges: Array  # [m] of the beams, which obstacles lower


@compilable
def sense(parameters: Array, memory: Array, signals: Array) -> None:
    """Fill ``signals`` with the range [m] of each beam of all robots, within the sensor's limits.

    It is the distance to obstacles, bodies that can be pushed, walkers, other robots and steered
    wheels.
    """
    places = unpack(Plane, parameters).places
    place_shapes(parameters, memory)
    for i in range(len(places) - 1):
        see(parameters, memory, i, signals[int(places[i, layout.SIGNALS]) :])


def sense_signals(parameters: Array, memory: Array, signals: Array) -> None:
    """Fill ``signals`` as ``sense`` does, and with the signals of all other sensors.

    It takes a sixth longer to compile than ``sense``, which suffices for most first runs.
    """
    sense(parameters, memory, signals)
    places = unpack(Plane, parameters).places
    for i in range(len(places) - 1):
        fill_signals(parameters, memory, i, signals[int(places[i, layout.SIGNALS]) :])


@compilable
def place_shapes(parameters: Array, memory: Array) -> None:
    """Move the shapes of the robots to where these are."""
    plane, placed = unpack(Plane, parameters), unpack(Memory, memory).shapes
    for i in range(len(plane.drives)):
        x, y, cos, sin = pose_of(memory, i)
        for k in range(
            int(plane.places[i, layout.SHAPES]), int(plane.places[i + 1, layout.SHAPES])
        ):
            place_obstacle(plane.shapes[k], x, y, cos, sin, placed[k])


@compilable
def see(parameters: Array, memory: Array, index: int, ranges: Array) -> None:
    """Fill in the range [m] of each beam of a robot."""
    plane, now = unpack(Plane, parameters), unpack(Memory, memory)
    sight = sight_of(parameters, index)
    beams = sight.beams
    for i in range(len(beams)):
        ranges[i] = beams[i, beam.FREE_RANGE]
    if len(sight.steered) > 0:
        see_parts_at(sight.steered, now.motions[index, layout.STEERING_ANGLE], ranges)
    pose = pose_of(memory, index)
    sensors = Sensors(beams, sight.groups, sight.rays, pose, ranges)
    cell = cell_at(sight.grid, pose[0], pose[1])
    if cell >= 0:
        for entry in range(int(sight.starts[cell]), int(sight.starts[cell + 1])):
            detect(sight.obstacles[int(sight.entries[entry])], sight.faces, sensors)
    faces = unpack(Movables, plane.movables).faces
    detect_all(unpack(Placed, now.movables).sights, faces, sensors)
    for other in range(len(now.motions)):
        if other != index:
            start = int(plane.places[other, layout.SHAPES])
            end = int(plane.places[other + 1, layout.SHAPES])
            detect_all(now.shapes[start:end], plane.faces, sensors)
    for i in range(len(beams)):
        if ranges[i] < beams[i, beam.MIN_RANGE]:
            ranges[i] = beams[i, beam.MIN_RANGE]


@compilable
def detect_all(obstacles: Array, faces: Array, sensors: Sensors) -> None:
    """Lower each range whose beam sees one of the obstacles at a shorter range."""
    for i in range(len(obstacles)):
        detect(obstacles[i], faces, sensors)


@compilable
def detect(obstacle: Array, faces: Array, sensors: Sensors) -> None:
    """Lower each range whose beam sees the obstacle at a shorter range."""
    x, y, cos, sin = sensors.pose
    dx = obstacle[ray.AT_X] - x
    dy = obstacle[ray.AT_Y] - y
    centre = cos * dx + sin * dy, cos * dy - sin * dx, obstacle[ray.AT_Z]
    for i in range(len(sensors.groups)):
        group = sensors.groups[i]
        if group[beam.SPACING] == 0.0:
            cast_beams(obstacle, faces, sensors, group, centre)
        else:
            cast_group(obstacle, faces, sensors, group, centre)


@compilable
def cast_group(
    obstacle: Array, faces: Array, sensors: Sensors, group: Array, centre: Point
) -> None:
    """Lower the ranges of an even group's beams; ``centre`` is the obstacle's, from the robot."""
    first_beam, end_beam = int(group[beam.FIRST_BEAM]), int(group[beam.END_BEAM])
    px, py, pz = find_centre(centre, sensors.beams[first_beam])
    reach = group[beam.REACH] + obstacle[ray.BOUND]
    if px * px + py * py >= reach * reach:
        return
    _, _, cos, sin = sensors.pose
    first_ray = int(sensors.beams[first_beam, beam.FIRST_RAY])
    low, high = beam.find_span(group, px, py, obstacle[ray.BOUND])
    turn = beam.FULL_TURN / group[beam.SPACING]
    for k in range(-1, 2):
        start = max(int(low + k * turn), 0)
        end = min(int(high + k * turn) + 1, end_beam - first_beam)
        if start < end:
            rays = sensors.rays[first_ray + start : first_ray + end]
            ranges = sensors.ranges[first_beam + start : first_beam + end]
            frame = turn_frame(obstacle, cos, sin)
            cast_rays(obstacle, faces, frame, (-px, -py, -pz), rays, math.inf, ranges)


@compilable
def find_centre(centre: Point, row: Array) -> Point:
    """Return the centre of an obstacle from the origin of a beam."""
    x, y, z = centre
    return x - row[beam.ORIGIN], y - row[beam.ORIGIN + 1], z - row[beam.ORIGIN + 2]


@compilable
def cast_beams(
    obstacle: Array, faces: Array, sensors: Sensors, group: Array, centre: Point
) -> None:
    """Lower the ranges of the beams of a group that is not even, as ``cast_group`` does."""
    _, _, cos, sin = sensors.pose
    ranges, bound = sensors.ranges, obstacle[ray.BOUND]
    for i in range(int(group[beam.FIRST_BEAM]), int(group[beam.END_BEAM])):
        row = sensors.beams[i]
        px, py, pz = find_centre(centre, row)
        left_x, left_y = row[beam.LEFT_EDGE], row[beam.LEFT_EDGE + 1]
        right_x, right_y = row[beam.RIGHT_EDGE], row[beam.RIGHT_EDGE + 1]
        # Skip the rays if the circle around the obstacle is too far away or beside the beam.
        far = ranges[i] + bound
        if px * px + py * py >= far * far:
            continue
        if px * left_x + py * left_y > bound or px * right_x + py * right_y > bound:
            continue
        frame = turn_frame(obstacle, cos, sin)
        if obstacle[ray.KIND] == ray.BOX and (
            is_beside(obstacle, frame, px, py, left_x, left_y)
            or is_beside(obstacle, frame, px, py, right_x, right_y)
            or is_beyond(obstacle, frame, (px, py, pz), ranges[i])
        ):
            continue
        rays = sensors.rays[int(row[beam.FIRST_RAY]) : int(row[beam.END_RAY])]
        origin = (-px, -py, -pz)
        ranges[i] = cast_rays(obstacle, faces, frame, origin, rays, ranges[i], ranges[:0])
