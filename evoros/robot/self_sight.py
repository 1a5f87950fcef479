"""Points where a sensor ray meets the robot, outside the housing of the sensor."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.compilation.rules import A1, A2, NOTHING, compile_rule
from evoros.geometry.ray import AT_X, AT_Y, AT_Z, BOUND, Frame, cast_rays, turn_frame
from evoros.robot.model import DIRECTION, HOUSING, LIMIT, ORIGIN, Robot, lay_out_rays
from evoros.robot.outline import OccluderRows
from evoros.sensor.protocol import Mount, RangeSensor, sees

SURFACE_M = 1e-3  # maximum depth [m] below a shape's surface that counts as on the surface
MAX_DIRECTIONS = 36  # maximum number of directions per scanner when checking many poses
_OUTSIDE_M = 100.0  # distance [m] at which every ray has left the robot


class SelfSight(NamedTuple):
    """The nearest part of the robot that a sensor sees at any steering angle."""

    name: str  # name of the sensor link
    mount: Mount
    distance_m: float  # distance [m] to the nearest part in any direction of the sensor
    link: str  # link of the nearest part
    hidden_share: float  # fraction of the sensor's rays that hit the robot


def measure_clear_ranges(robot: Robot) -> Array:
    """Return each beam's range (n,) [m] without obstacles, which the robot itself may limit."""
    rays, starts = robot.ray_table
    farthest: Array = rays[starts[:-1], LIMIT]
    occluders = robot.occluders.fixed
    if not len(occluders.rows) or not len(rays):
        return farthest
    distances, _ = cast_at_robot(occluders, rays)
    return np.minimum(np.minimum.reduceat(distances, starts[:-1]), farthest)


def find_seeing_beams(robot: Robot) -> list[NDArray[np.bool_]]:
    """Return, for each mount, a mask of the beams that hit the robot at some steering angle."""
    swept = robot.occluders.sweep(robot.drive)
    swept = swept._replace(inside=np.where(swept.rolls > 0.0, 0.0, math.inf))
    rays, starts = robot.ray_table
    distances, _ = cast_at_robot(swept, rays)
    seeing = np.array([], dtype=np.bool_)
    if len(rays):
        seeing = np.minimum.reduceat(distances, starts[:-1]) < rays[starts[:-1], LIMIT]
    return [seeing[part] for part in robot.beam_layout]


def list_spans(marked: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the (first, last) index of each run of True values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], marked, [0]])))
    return [(first, end - 1) for first, end in edges.reshape(-1, 2).tolist()]


def find_self_sights(robot: Robot) -> Iterator[SelfSight]:
    """Yield the nearest visible part of the robot for each range sensor that sees any."""
    swept = robot.occluders.sweep(robot.drive)
    for (name, mount), frame in zip(robot.named_mounts(), robot.sensor_frames, strict=True):
        sensor = robot.sensors[mount.sensor]
        if not sees(sensor):
            continue
        rays = lay_out_rays(sensor, sensor.rays(), frame[None])
        distances, numbers = cast_at_robot(swept, rays)
        hidden = distances < sensor.range_max_m
        if hidden.any():
            nearest = int(distances.argmin())
            link = robot.occluders.shapes[int(numbers[nearest])].link
            yield SelfSight(name, mount, float(distances[nearest]), link, float(hidden.mean()))


class BlindShares:
    """Computes the fraction of a sensor's channels that hit ``robot``, for any sensor pose."""

    def __init__(self, robot: Robot, sensor: RangeSensor) -> None:
        rays, channels = sensor.rays(), np.asarray(sensor.channel_of())
        if len(sensor.channels) > MAX_DIRECTIONS:
            kept = channels % -(-len(sensor.channels) // MAX_DIRECTIONS) == 0
            rays, channels = rays[kept], channels[kept]
        self._sensor, self._rays, self._occluders = sensor, rays, robot.occluders.sweep(robot.drive)
        self._channels = [channels == channel for channel in np.unique(channels)]

    def find(self, frames: Array) -> Array:
        """Return the fraction (n,) for each sensor frame (n, 4, 4) [m] in the robot's frame."""
        table = lay_out_rays(self._sensor, self._rays, frames)
        distances, _ = cast_at_robot(self._occluders, table)
        hidden = (distances < self._sensor.range_max_m).reshape(-1, len(self._rays))
        blind = [hidden[:, channel].any(axis=1) for channel in self._channels]
        return np.asarray(np.mean(blind, axis=0))


MEET_SHAPES = NOTHING(A2, A2, A1, A1, A1, A2, A2, A2, A1, A1)


def cast_at_robot(occluders: OccluderRows, rays: Array) -> tuple[Array, Array]:
    """Return the distance (k,) [m] to the nearest shape on each ray, or infinity, and its index."""
    distances, numbers = np.full(len(rays), math.inf), np.full(len(rays), -1.0)
    rule = compile_rule(meet_shapes, MEET_SHAPES)
    backward = np.ascontiguousarray(-rays[:, DIRECTION : DIRECTION + 3])
    rule(*occluders, np.ascontiguousarray(rays), backward, distances, numbers)
    return distances, numbers


def meet_shapes(
    rows: Array,
    faces: Array,
    inside: Array,
    rolls: Array,
    occluders: Array,
    heights: Array,
    rays: Array,
    backward: Array,
    distances: Array,
    numbers: Array,
) -> None:
    """Shorten each ray's distance [m] to the nearest shape, and store the index of that shape."""
    for s in range(len(rows)):
        row = rows[s]
        frame = turn_frame(row, 1.0, 0.0)
        for i in range(len(rays)):
            x = rays[i, ORIGIN] - row[AT_X]
            y = rays[i, ORIGIN + 1] - row[AT_Y]
            reach = rays[i, LIMIT] + row[BOUND]
            if x * x + y * y > reach * reach or _passes(row, heights[s], rays[i], x, y):
                continue
            distance = meet_shape(
                row, faces, frame, (x, y, rays[i, ORIGIN + 2] - row[AT_Z]),
                rays, i, backward, inside[s], rolls[s] > 0.0,
            )  # fmt: skip
            if distance < distances[i]:
                distances[i] = distance
                numbers[i] = occluders[s]


@compilable
def _passes(row: Array, heights: Array, ray: Array, x: float, y: float) -> bool:
    """Return True only if a ray from x, y [m] (relative to a shape) misses the shape."""
    dx, dy = ray[DIRECTION], ray[DIRECTION + 1]
    level = dx * dx + dy * dy
    bound = row[BOUND] + SURFACE_M
    across = x * dy - y * dx
    if across * across > bound * bound * level:
        return True
    if level < 1e-6:  # vertical
        return False
    start = ray[ORIGIN + 2]
    end = start + ray[DIRECTION + 2] * (math.sqrt(x * x + y * y) + bound) / math.sqrt(level)
    low, high = heights[0] - SURFACE_M, heights[1] + SURFACE_M
    return bool((start > high and end > high) or (start < low and end < low))


@compilable
def meet_shape(
    row: Array,
    faces: Array,
    frame: Frame,
    origin: tuple[float, float, float],
    rays: Array,
    i: int,
    backward: Array,
    inside: float,
    rolls: bool,
) -> float:
    """Return the distance [m] at which ray ``i`` hits a shape of the robot, or infinity.

    ``origin`` [m] is relative to the centre of the shape. The body that carries the sensor may
    extend into the sensor's housing; wheels and casters (``rolls``) may not.
    """
    housing = 0.0 if rolls else rays[i, HOUSING]
    behind = 0.0 if rolls else SURFACE_M
    x, y, z = origin
    dx, dy, dz = rays[i, 0], rays[i, 1], rays[i, 2]
    entered = -behind + cast_rays(
        row, faces, frame, (x - behind * dx, y - behind * dy, z - behind * dz),
        rays[i : i + 1], math.inf, rays[i, :0],
    )  # fmt: skip
    if housing <= entered < math.inf:
        return entered
    starts_inside = entered == math.inf
    limit = inside if starts_inside else housing
    if limit == math.inf:
        return math.inf
    left = _OUTSIDE_M - cast_rays(
        row, faces, frame, (x + _OUTSIDE_M * dx, y + _OUTSIDE_M * dy, z + _OUTSIDE_M * dz),
        backward[i : i + 1], math.inf, rays[i, :0],
    )  # fmt: skip
    if left <= limit:
        return math.inf
    return 0.0 if starts_inside else housing
