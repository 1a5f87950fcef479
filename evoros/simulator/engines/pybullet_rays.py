"""The rays of a robot's sensors in PyBullet."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from evoros.base.arrays import Array
from evoros.base.linear import product
from evoros.robot.model import Robot
from evoros.simulator.engines.pybullet_robot import LoadedRobot
from evoros.simulator.engines.pybullet_shapes import Frame
from evoros.simulator.engines.rays import sensor_beams
from evoros.simulator.engines.steered_sight import SteeredParts

MAX_RAYS = 16_383
"""One call of rayTestBatch takes no more."""


class Span(NamedTuple):
    """The rays of one beam within a batch."""

    first: int
    end: int  # one past the last
    range_min: float  # [m]
    range_max: float  # [m]
    clear_range: float  # [m], without obstacles


class Batch(NamedTuple):
    """Rays that one call of the engine casts, in the frame of the chassis' centre of mass."""

    starts: list[list[float]]  # (k, 3) [m]
    ends: list[list[float]]  # (k, 3) [m]
    spans: list[Span]


class BulletRays:
    """The rays of all range sensors of a robot, which the engine moves along."""

    def __init__(self, bullet: Any, loaded: LoadedRobot, robot: Robot) -> None:
        self._bullet, self._body = bullet, loaded.body
        self._seen, self._batches = loaded.seen, _batches(robot, bullet, loaded.to_base)
        self._parts, self._steering = SteeredParts(robot), loaded.steering
        self._low = np.array([span.range_min for batch in self._batches for span in batch.spans])

    def cast(self, ranges: Array) -> None:
        """Fill ``ranges`` with the nearest hit [m] of each beam, within the sensor's range.

        A ray that starts inside a shape does not see it.
        """
        beam = 0
        for starts, ends, spans in self._batches:
            fractions = [hit[2] for hit in self._cast(starts, ends)]
            if 0.0 in fractions:
                self._look_beyond(starts, ends, fractions)
            for first, end, range_min, range_max, clear_range in spans:
                distance = min(clear_range, range_max * min(fractions[first:end]))
                ranges[beam] = distance if distance > range_min else range_min
                beam += 1
        if self._parts.exist:
            self._parts.lower(self._read_steering(), ranges)
            np.maximum(ranges, self._low, out=ranges)

    def _read_steering(self) -> Array:
        """Return the angles [rad] of the steering joints."""
        states = self._bullet.getJointStates(self._body, self._steering)
        return np.array([state[0] for state in states])

    def _cast(self, starts: Sequence[Any], ends: Sequence[Any], rank: int = -1) -> Sequence[Any]:
        """The nearest hit of each ray; with a ``number``, one of all its hits, in any order."""
        hits: Sequence[Any] = self._bullet.rayTestBatch(
            starts,
            ends,
            parentObjectUniqueId=self._body,
            parentLinkIndex=-1,
            reportHitNumber=rank,
            collisionFilterMask=self._seen,
        )
        return hits

    def _look_beyond(
        self, starts: Sequence[Any], ends: Sequence[Any], fractions: list[float]
    ) -> None:
        """Correct rays that start inside a shape at which the engine ends them."""
        inside = [ray for ray, fraction in enumerate(fractions) if fraction == 0.0]
        starts, ends = [starts[ray] for ray in inside], [ends[ray] for ray in inside]
        nearest, rank, left = [1.0] * len(inside), 0, True
        while left:
            hits = self._cast(starts, ends, rank)
            nearest = [min(n, hit[2] or 1.0) for n, hit in zip(nearest, hits, strict=True)]
            left, rank = any(hit[0] >= 0 for hit in hits), rank + 1
        for ray, fraction in zip(inside, nearest, strict=True):
            fractions[ray] = fraction


def _batches(robot: Robot, bullet: Any, to_base: Frame) -> list[Batch]:
    position, quaternion = to_base
    rotation = np.array(bullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)
    batches: list[Batch] = []
    turned = _turn_rays(robot, rotation)
    for beam, directions in zip(sensor_beams(robot), turned, strict=True):
        origin = product(rotation, beam.origin) + position
        ends = origin + beam.range_max * directions
        if not batches or len(batches[-1].starts) + len(ends) > MAX_RAYS:
            batches.append(Batch([], [], []))
        batch = batches[-1]
        first = len(batch.starts)
        limits = beam.range_min, beam.range_max, beam.clear_range
        batch.spans.append(Span(first, first + len(ends), *limits))
        batch.starts.extend([origin.tolist()] * len(ends))
        batch.ends.extend(ends.tolist())
    return batches


def _turn_rays(robot: Robot, rotation: Array) -> Iterator[Array]:
    """Yield the directions (k, 3) of each beam along other axes, turned and rounded only once."""
    for mount, frame in zip(robot.mounts, robot.sensor_frames, strict=True):
        if mount.sensor in robot.sorted_rays:
            rays, ends = robot.sorted_rays[mount.sensor]
            directions = product(rays, product(rotation, frame[:3, :3]).T)
            for start, end in pairwise((0, *ends)):
                yield directions[start:end]
