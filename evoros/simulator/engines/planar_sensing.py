"""The sensing rules of robots in the plane, on the arrays of ``planar_layout``."""

import math
from typing import NamedTuple

from evoros.base import elementary
from evoros.base.arrays import SPEED, YAW, YAW_RATE, Array, Matrix
from evoros.base.compilable import compilable, inlined
from evoros.base.packing import unpack
from evoros.geometry import ray
from evoros.geometry.grid import cell_at
from evoros.geometry.ray import Point, cast_rays, is_beside, is_beyond, place_obstacle, turn_frame
from evoros.sensor import signals as signal
from evoros.simulator.engines import planar_layout as layout
from evoros.simulator.engines.planar_bodies import Movables, Placed, PlanarPose
from evoros.simulator.engines.rays import see_parts_at

FULL_TURN = 2.0 * math.pi

UNSURE_RAD = 1e-4  # widens circles in ``find_span``, beyond its errors and uneven spacing


@compilable
def fill_signals(parameters: Array, memory: Array, index: int, signals: Array) -> None:
    """Write the signals of all probes on a robot."""
    probes, now = layout.probes_of(parameters, index), unpack(layout.Memory, memory)
    motion = now.motions[index]
    for i in range(len(probes.motion)):
        fill_motion(parameters, memory, index, probes.motion[i], signals)
    for i in range(len(probes.wheels)):
        place = int(probes.wheels[i])
        signals[place + signal.DISTANCE] = motion[layout.ROLLED]
        signals[place + signal.TURN] = motion[layout.TURNED]
    touched = int(unpack(layout.Plane, parameters).places[index, layout.TOUCHES])
    for i in range(len(probes.contact)):
        place = int(probes.contact[i, layout.PLACE])
        signals[place + signal.TOUCHES] = now.touches[touched + i]


@compilable
def fill_motion(parameters: Array, memory: Array, index: int, probe: Array, signals: Array) -> None:
    """Write the motion of a probe's frame on a robot."""
    motion = unpack(layout.Memory, memory).motions[index]
    drive = unpack(layout.Drive, unpack(layout.Plane, parameters).drives[index])
    x, y, cos, sin = layout.pose_of(memory, index)
    signals = signals[int(probe[layout.PLACE]) :]
    px = probe[layout.FRAME]
    py = probe[layout.FRAME + 1]
    signals[signal.POSITION] = x + cos * px - sin * py
    signals[signal.POSITION + 1] = y + sin * px + cos * py
    signals[signal.POSITION + 2] = probe[layout.FRAME + 2]
    # yaw rotation of the robot times mounting rotation of the sensor
    z, w = elementary.sin_cos(0.5 * motion[YAW])
    qw = probe[layout.FRAME + 3]
    qx = probe[layout.FRAME + 4]
    qy = probe[layout.FRAME + 5]
    qz = probe[layout.FRAME + 6]
    signals[signal.ORIENTATION] = w * qw - z * qz
    signals[signal.ORIENTATION + 1] = w * qx - z * qy
    signals[signal.ORIENTATION + 2] = w * qy + z * qx
    signals[signal.ORIENTATION + 3] = w * qz + z * qw
    # the rear axle moves along the robot's heading
    ahead = motion[SPEED] - motion[YAW_RATE] * py
    aside = motion[YAW_RATE] * (px - drive.rear_axle_x)
    signals[signal.VELOCITY] = cos * ahead - sin * aside
    signals[signal.VELOCITY + 1] = sin * ahead + cos * aside
    signals[signal.VELOCITY + 2] = 0.0
    signals[signal.TURNING] = 0.0
    signals[signal.TURNING + 1] = 0.0
    signals[signal.TURNING + 2] = motion[YAW_RATE]
    signals[signal.GRAVITY] = probe[layout.GRAVITY]


class Sensors(NamedTuple):
    """The sensors and pose of a robot, and the ranges found so far."""

    beams: Matrix
    groups: Matrix
    rays: Matrix
    pose: PlanarPose
    ranges: Array  # [m], one per beam, shortened by obstacles


@compilable
def sense(parameters: Array, memory: Array, signals: Array) -> None:
    """Fill ``signals`` with the range [m] of each beam of all robots, within its limits."""
    places = unpack(layout.Plane, parameters).places
    place_shapes(parameters, memory)
    for i in range(len(places) - 1):
        see(parameters, memory, i, signals[int(places[i, layout.SIGNALS]) :])


def sense_signals(parameters: Array, memory: Array, signals: Array) -> None:
    """Fill ``signals`` for all sensors; ``sense``, which fills only ranges, compiles faster."""
    sense(parameters, memory, signals)
    places = unpack(layout.Plane, parameters).places
    for i in range(len(places) - 1):
        fill_signals(parameters, memory, i, signals[int(places[i, layout.SIGNALS]) :])


@compilable
def place_shapes(parameters: Array, memory: Array) -> None:
    """Move the shapes of robots to the current poses."""
    plane, placed = unpack(layout.Plane, parameters), unpack(layout.Memory, memory).shapes
    for i in range(len(plane.drives)):
        x, y, cos, sin = layout.pose_of(memory, i)
        for k in range(
            int(plane.places[i, layout.SHAPES]), int(plane.places[i + 1, layout.SHAPES])
        ):
            place_obstacle(plane.shapes[k], x, y, cos, sin, placed[k])


@compilable
def see(parameters: Array, memory: Array, index: int, ranges: Array) -> None:
    """Write the range [m] of each beam of a robot."""
    plane, now = unpack(layout.Plane, parameters), unpack(layout.Memory, memory)
    sight = layout.sight_of(parameters, index)
    beams = sight.beams
    for i in range(len(beams)):
        ranges[i] = beams[i, layout.FREE_RANGE]
    if len(sight.steered) > 0:
        see_parts_at(sight.steered, now.motions[index, layout.STEERING_ANGLE], ranges)
    pose = layout.pose_of(memory, index)
    sensors = Sensors(beams, sight.groups, sight.rays, pose, ranges)
    cell = cell_at(sight.grid, pose[0], pose[1])
    placed, faces = unpack(Placed, now.movables).sights, unpack(Movables, plane.movables).faces
    for g in range(len(sight.groups)):
        if cell >= 0 and sight.starts[cell] < sight.starts[cell + 1]:
            entries = sight.entries[int(sight.starts[cell]) : int(sight.starts[cell + 1])]
            detect(sight.obstacles, entries, sight.faces, sensors, g)
        detect(placed, ranges[:0], faces, sensors, g)
        for other in range(len(now.motions)):
            if other != index:
                start = int(plane.places[other, layout.SHAPES])
                end = int(plane.places[other + 1, layout.SHAPES])
                detect(now.shapes[start:end], ranges[:0], plane.faces, sensors, g)
    for i in range(len(beams)):
        if ranges[i] < beams[i, layout.MIN_RANGE]:
            ranges[i] = beams[i, layout.MIN_RANGE]


@compilable
def detect(obstacles: Matrix, entries: Array, faces: Array, sensors: Sensors, group: int) -> None:
    """Shorten a group's beams that hit obstacles, in rows ``entries`` or, if empty, in all rows."""
    fan = fan_of(sensors, group)
    x, y, cos, sin = sensors.pose
    for entry in range(len(entries) if len(entries) > 0 else len(obstacles)):
        row = int(entries[entry]) if len(entries) > 0 else entry
        # Views of rows would cost more than most obstacles, which are out of reach.
        dx = obstacles[row, ray.AT_X] - x
        dy = obstacles[row, ray.AT_Y] - y
        centre = cos * dx + sin * dy, cos * dy - sin * dx, obstacles[row, ray.AT_Z]
        if fan.spacing != 0.0:
            cast_fan(obstacles, row, faces, sensors, fan, centre)
        else:
            cast_beams(obstacles, row, faces, sensors, fan, centre)


class Fan(NamedTuple):
    """The values of a group that do not depend on the obstacle."""

    first_beam: int
    end_beam: int
    bearing: float  # [rad], bearing of the first beam
    spacing: float  # [rad], 0 if uneven
    reach: float  # [m]
    first_ray: int
    origin: Point  # [m], origin of the first beam


@inlined
def fan_of(sensors: Sensors, group: int) -> Fan:
    """Return the values of a group."""
    groups, beams = sensors.groups, sensors.beams
    first = int(groups[group, layout.FIRST_BEAM])
    return Fan(
        first,
        int(groups[group, layout.END_BEAM]),
        groups[group, layout.BEARING],
        groups[group, layout.SPACING],
        groups[group, layout.REACH],
        int(beams[first, layout.FIRST_RAY]),
        (
            beams[first, layout.ORIGIN],
            beams[first, layout.ORIGIN + 1],
            beams[first, layout.ORIGIN + 2],
        ),
    )


@inlined
def cast_fan(
    obstacles: Matrix, row: int, faces: Array, sensors: Sensors, fan: Fan, centre: Point
) -> None:
    """Shorten the ranges of an evenly spaced group; ``centre`` is relative to the robot."""
    px = centre[0] - fan.origin[0]
    py = centre[1] - fan.origin[1]
    pz = centre[2] - fan.origin[2]
    bound = obstacles[row, ray.BOUND]
    reach = fan.reach + bound
    if px * px + py * py >= reach * reach:
        return
    low, high = find_span(fan, px, py, bound)
    turn = FULL_TURN / fan.spacing
    for k in range(-1, 2):
        start = max(math.ceil(low + k * turn), 0)
        end = min(math.floor(high + k * turn) + 1, fan.end_beam - fan.first_beam)
        if start < end:
            rays = sensors.rays[fan.first_ray + start : fan.first_ray + end]
            ranges = sensors.ranges[fan.first_beam + start : fan.first_beam + end]
            frame = turn_frame(obstacles[row], sensors.pose[2], sensors.pose[3])
            cast_rays(obstacles[row], faces, frame, (-px, -py, -pz), rays, math.inf, ranges)


@compilable
def find_span(fan: Fan, x: float, y: float, radius: float) -> tuple[float, float]:
    """Return the beams' index range, up to a full turn off, that a circle at x, y [m] may block."""
    squared = x * x + y * y
    if squared <= radius * radius:
        return 0.0, float(fan.end_beam - fan.first_beam)
    sine = radius / math.sqrt(squared)
    square = sine * sine
    # Two terms of the arcsine series, and a term that bounds the sum of all further terms.
    half = sine * (1.0 + square * (1.0 / 6.0 + square * (math.pi / 2.0 - 7.0 / 6.0)))
    middle = estimate_bearing(x, y) - fan.bearing
    if middle < 0.0:
        middle += FULL_TURN
    half += UNSURE_RAD
    return (middle - half) / fan.spacing, (middle + half) / fan.spacing


@compilable
def estimate_bearing(x: float, y: float) -> float:
    """Return atan2(y, x) [rad] with an error below 2e-5."""
    across, along = abs(y), abs(x)
    steep = across > along
    ratio = along / across if steep else across / along
    z = ratio * ratio
    # 4.4.47 of Abramowitz and Stegun, Handbook of Mathematical Functions (1964)
    angle = 0.0208351
    angle = angle * z - 0.0851330
    angle = angle * z + 0.1801410
    angle = angle * z - 0.3302995
    angle = (angle * z + 0.9998660) * ratio
    if steep:
        angle = 0.5 * math.pi - angle
    if x < 0.0:
        angle = math.pi - angle
    return -angle if y < 0.0 else angle


@compilable
def cast_beams(
    obstacles: Matrix, row: int, faces: Array, sensors: Sensors, fan: Fan, centre: Point
) -> None:
    """Shorten the ranges of an unevenly spaced group; see ``cast_fan``."""
    _, _, cos, sin = sensors.pose
    ranges, beams, bound = sensors.ranges, sensors.beams, obstacles[row, ray.BOUND]
    x, y, z = centre
    for i in range(fan.first_beam, fan.end_beam):
        px = x - beams[i, layout.ORIGIN]
        py = y - beams[i, layout.ORIGIN + 1]
        # Skip rays if the circle around the obstacle is out of range or outside the beam.
        far = ranges[i] + bound
        if px * px + py * py >= far * far:
            continue
        left_x, left_y = beams[i, layout.LEFT_EDGE], beams[i, layout.LEFT_EDGE + 1]
        right_x, right_y = beams[i, layout.RIGHT_EDGE], beams[i, layout.RIGHT_EDGE + 1]
        if px * left_x + py * left_y > bound or px * right_x + py * right_y > bound:
            continue
        pz = z - beams[i, layout.ORIGIN + 2]
        obstacle = obstacles[row]
        frame = turn_frame(obstacle, cos, sin)
        if obstacle[ray.KIND] == ray.BOX and (
            is_beside(obstacle, frame, px, py, left_x, left_y)
            or is_beside(obstacle, frame, px, py, right_x, right_y)
            or is_beyond(obstacle, frame, (px, py, pz), ranges[i])
        ):
            continue
        rays = sensors.rays[int(beams[i, layout.FIRST_RAY]) : int(beams[i, layout.END_RAY])]
        origin = (-px, -py, -pz)
        ranges[i] = cast_rays(obstacle, faces, frame, origin, rays, ranges[i], ranges[:0])
