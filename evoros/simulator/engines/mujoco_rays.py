"""Casts the rays of a robot's sensors in MuJoCo."""

from typing import Any, NamedTuple

import numpy as np

from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.compilation.rules import A1, A2, NOTHING, TRUTH, compile_rule
from evoros.robot.model import Robot
from evoros.simulator.engines.mujoco_bodies import HIDDEN, MOVABLE, ROBOT, VISIBLE
from evoros.simulator.engines.mujoco_model import Model
from evoros.simulator.engines.rays import Beam, SteeredParts, sensor_beams


class Sensor(NamedTuple):
    """The rays of a range sensor, with prepared arguments for the ray-casting call."""

    rays: slice
    arguments: tuple[Any, ...]


class MujocoSight:
    """The range sensors of a robot, which detect other robots but not their own."""

    def __init__(self, model: Model, robot: Robot, index: int) -> None:
        self._groups, self._data = model.model.geom_group, model.data
        placed = model.robots[index]
        first, _ = placed.root
        self._pose, self._steering = model.data.qpos[first : first + 7], placed.steering
        rest = [other.visible for i, other in enumerate(model.robots) if i != index]
        self._others = np.concatenate([np.zeros(0, dtype=int), *rest])  # shapes of the other robots
        self._call = model.library.mj_multiRay
        self._place = compile_rule(place_rays, NOTHING(A1, A2, A2, A2, A2))
        self._leave = compile_rule(leaves_shape, TRUTH(A2, A2))
        self._read = compile_rule(read_hits, NOTHING(A1, A1, A1, A1, A1))
        beams = sensor_beams(robot)
        parts = [part for part in robot.beam_layout if part.stop > part.start]
        ends = np.cumsum([0, *(len(beam.directions) for beam in beams)])
        self._origins = np.array([beams[part.start].origin for part in parts]).reshape(-1, 3)
        self._directions = np.concatenate([np.zeros((0, 3)), *(b.directions for b in beams)])
        self._ends = ends.astype(float)
        self._low = np.array([beam.range_min for beam in beams])
        self._high = np.array([beam.clear_range for beam in beams])
        self._parts = SteeredParts(robot)
        self._hits = np.zeros(ends[-1])
        self._seen = np.zeros(ends[-1], dtype=np.int32)
        self._normals = np.zeros((ends[-1], 3))  # outward surface normals; 0 without a hit
        self._starts, self._turned = np.zeros((len(parts), 3)), np.zeros((ends[-1], 3))
        self._sensors = [
            self._bind(model, index, slice(ends[part.start], ends[part.stop]), beams[part.start])
            for index, part in enumerate(parts)
        ]

    def _bind(self, model: Model, index: int, rays: slice, beam: Beam) -> Sensor:
        arguments = (
            model.model,
            model.data,
            self._starts[index],
            self._turned[rays].reshape(-1),
            VISIBLE,
            True,  # include fixed shapes
            -1,
            self._seen[rays],
            self._hits[rays],
            self._normals[rays].reshape(-1),
            int(rays.stop - rays.start),
            beam.range_max,
        )
        return Sensor(rays, arguments)

    def cast(self, ranges: Array) -> None:
        """Fill ``ranges`` (n,) [m]; the engine must have updated the poses of the shapes."""
        if not self._sensors:
            return
        self._groups[self._others] = MOVABLE
        self._place(self._pose, self._origins, self._directions, self._starts, self._turned)
        call, surfaces = self._call, (self._turned, self._normals)
        for _, arguments in self._sensors:
            call(*arguments)
        if self._leave(*surfaces):
            for sensor in self._sensors:
                self._cast_from_inside(sensor)
        self._read(self._hits, self._ends, self._low, self._high, ranges)
        if self._parts.exist:
            self._parts.lower(self._data.qpos[self._steering], ranges)
            np.maximum(ranges, self._low, out=ranges)
        self._groups[self._others] = ROBOT

    def _cast_from_inside(self, sensor: Sensor) -> None:
        rays, groups = sensor.rays, self._groups
        before = groups.copy()
        turned, normals = self._turned[rays], self._normals[rays]
        while (leaving := (turned * normals).sum(axis=1) > 0.0).any():
            groups[self._seen[rays][leaving]] = HIDDEN
            self._call(*sensor.arguments)
        groups[:] = before


def place_rays(
    pose: Array, origins: Array, directions: Array, starts: Array, turned: Array
) -> None:
    """Write ray origins and directions (n, 3) in the world for a ``pose`` of the root link."""
    rotation = rotation_entries(pose[3], pose[4], pose[5], pose[6])
    for row in range(len(origins)):
        _turn(rotation, origins[row], starts[row])
        for axis in range(3):
            starts[row, axis] += pose[axis]
    for row in range(len(directions)):
        _turn(rotation, directions[row], turned[row])


@compilable
def _turn(rotation: tuple[float, ...], vector: Array, turned: Array) -> None:
    xx, xy, xz, yx, yy, yz, zx, zy, zz = rotation
    x, y, z = vector[0], vector[1], vector[2]
    turned[0] = xx * x + xy * y + xz * z
    turned[1] = yx * x + yy * y + yz * z
    turned[2] = zx * x + zy * y + zz * z


def leaves_shape(turned: Array, normals: Array) -> bool:
    """Return True if a ray hits a shape from inside; ``normals`` (n, 3) are outward (0: no hit)."""
    for row in range(len(turned)):
        along = 0.0
        for axis in range(3):
            along += turned[row, axis] * normals[row, axis]
        if along > 0.0:
            return True
    return False


def read_hits(hits: Array, ends: Array, low: Array, high: Array, ranges: Array) -> None:
    """Write the nearest hit [m] of each beam; beam i starts at ray ``ends[i]``; misses are < 0."""
    for beam in range(len(ranges)):
        nearest = high[beam]
        for ray in range(int(ends[beam]), int(ends[beam + 1])):
            if 0.0 <= hits[ray] < nearest:
                nearest = hits[ray]
        ranges[beam] = max(nearest, low[beam])


@compilable
def rotation_entries(w: float, i: float, j: float, k: float) -> tuple[float, ...]:
    """Return the entries of a unit quaternion's rotation matrix, row by row."""
    return (
        1 - 2 * (j * j + k * k),
        2 * (i * j - k * w),
        2 * (i * k + j * w),
        2 * (i * j + k * w),
        1 - 2 * (i * i + k * k),
        2 * (j * k - i * w),
        2 * (i * k - j * w),
        2 * (j * k + i * w),
        1 - 2 * (i * i + j * j),
    )


def root_frame(pose: Array) -> tuple[Array, Array]:
    """Return the rotation (3, 3) and position (3,) [m] of the root link."""
    x, y, z, *quaternion = pose.tolist()
    return np.array(rotation_entries(*quaternion)).reshape(3, 3), np.array([x, y, z])
