"""A mission in PyBullet: observe, sense and advance."""

import math
from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from evoros.base.arrays import CONTACT, Array, product
from evoros.drive.protocol import find_targets, lag_gain
from evoros.robot.model import Robot
from evoros.simulator.engines.pybullet_model import AT_REST, Engine, Model, Settings
from evoros.simulator.engines.pybullet_robot import LoadedRobot
from evoros.simulator.engines.rays import SteeredParts, sensor_beams
from evoros.simulator.engines.rigid_signals import Motion, RigidSignals, fill_state
from evoros.simulator.engines.teams import Frame, read_command, share_arrays
from evoros.simulator.engines.walking import GAP_M, EngineWalkers
from evoros.walkers.crowd import Crowd

MAX_RAYS = 16_383  # maximum number of rays per call of ``rayTestBatch``


class Span(NamedTuple):
    """The range of ray indices of one beam within a batch, with the beam's limits."""

    first: int
    end: int  # index after the last ray
    range_min: float  # [m]
    range_max: float  # [m]
    clear_range: float  # [m], reading without obstacles


class Batch(NamedTuple):
    """Rays for one call of the engine, relative to the chassis' centre of mass."""

    starts: list[list[float]]  # (k, 3) [m]
    ends: list[list[float]]  # (k, 3) [m]
    spans: list[Span]


class BulletRays:
    """The rays of all range sensors of a robot, which the engine moves with the robot."""

    def __init__(self, bullet: Any, loaded: LoadedRobot, robot: Robot) -> None:
        self._bullet, self._body = bullet, loaded.body
        self._seen, self._batches = loaded.seen, _batches(robot, bullet, loaded.to_base)
        self._parts, self._steering = SteeredParts(robot), loaded.steering
        self._low = np.array([span.range_min for batch in self._batches for span in batch.spans])

    def cast(self, ranges: Array) -> None:
        """Fill ``ranges`` (n,) with the nearest hit [m] of each beam, within the sensor limits."""
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
            states = self._bullet.getJointStates(self._body, self._steering)
            self._parts.lower(np.array([state[0] for state in states]), ranges)
            np.maximum(ranges, self._low, out=ranges)

    def _cast(self, starts: Sequence[Any], ends: Sequence[Any], rank: int = -1) -> Sequence[Any]:
        """Return the nearest hit of each ray or, with ``rank``, one of its unordered hits."""
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
        """Correct the hits of rays that end in the shape in which they start."""
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
    for beam, directions in zip(sensor_beams(robot), _turn_rays(robot, rotation), strict=True):
        origin = product(rotation, beam.origin) + position
        ends = origin + beam.range_max * directions
        if not batches or len(batches[-1].starts) + len(ends) > MAX_RAYS:
            batches.append(Batch([], [], []))
        batch, first = batches[-1], len(batches[-1].starts)
        limits = beam.range_min, beam.range_max, beam.clear_range
        batch.spans.append(Span(first, first + len(ends), *limits))
        batch.starts.extend([origin.tolist()] * len(ends))
        batch.ends.extend(ends.tolist())
    return batches


def _turn_rays(robot: Robot, rotation: Array) -> Iterator[Array]:
    """Yield the directions (k, 3) of each beam after a rotation, rounded only once."""
    for mount, frame in zip(robot.mounts, robot.sensor_frames, strict=True):
        if mount.sensor in robot.sorted_rays:
            rays, ends = robot.sorted_rays[mount.sensor]
            directions = product(rays, product(rotation, frame[:3, :3]).T)
            for start, end in pairwise((0, *ends)):
                yield directions[start:end]


class BulletSignals(RigidSignals):
    """The signals of a robot in a PyBullet model."""

    def __init__(self, bullet: Any, model: Model, robot: Robot, index: int) -> None:
        self._bullet = bullet
        self._ground, self._robot = model.ground, model.robots[index]
        settings = bullet.getPhysicsEngineParameters()
        super().__init__(robot, -float(settings["gravityAccelerationZ"]))

    def read(self, signals: Array) -> None:
        """Write the robot's readings into their slices of ``signals``."""
        if self.exist:
            robot = self._robot
            states = self._bullet.getJointStates(robot.body, robot.wheels)
            self.fill(signals, self._find_motion(), [state[0] for state in states])

    def _find_motion(self) -> Motion:
        bullet, robot = self._bullet, self._robot
        center, facing = bullet.getBasePositionAndOrientation(robot.body)
        velocity, turning = map(np.array, bullet.getBaseVelocity(robot.body))
        position, quaternion = bullet.multiplyTransforms(center, facing, *robot.to_base)
        rotation = np.array(bullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)
        arm = np.array(position) - np.array(center)
        return Motion(np.array(position), rotation, velocity + np.cross(turning, arm), turning)

    def feel(self) -> None:
        """Count this step for each contact zone in which something touches the robot."""
        touches: dict[tuple[int, int, int], list[Any]] = {}  # keyed by link, other body, other link
        for link, point in find_touches(self._bullet, self._robot, self._ground):
            touches.setdefault((link, point[2], point[4]), []).append(point[5])
        if touches:
            position, rotation, *_ = self._find_motion()
            pieces = (product(np.array(points) - position, rotation) for points in touches.values())
            self.touch(points[:, :2] for points in pieces)


def find_touches(
    bullet: Any, robot: LoadedRobot, ground: Collection[int]
) -> Iterator[tuple[int, Any]]:
    """Yield (link, contact point) for each contact with an obstacle: a force or an overlap."""
    for link in robot.touching:
        for point in bullet.getContactPoints(robot.body, -1, link, -2):
            if point[2] not in ground and (point[8] <= 0.0 or point[9] > 0.0):
                yield link, point


FINE_STEP_S = 0.0025
"""Time step [s] while a movable body moves. The engine finds one contact with a plane per step, and
keeps it for 2 % of the body's size; with longer steps, bodies rest on one corner and sink.
"""

NEAR_STEPS = 2.0  # distance at which fine steps begin, in steps at full speed


class PyBulletSimulation:
    """The simulated robots of a PyBullet model in a world."""

    def __init__(
        self,
        engine: Engine,
        model: Model,
        robots: Sequence[Robot],
        settings: Settings,
        crowd: Crowd | None = None,
    ) -> None:
        self._bullet, self._model = engine.bullet, model
        self._time_step = settings.time_step
        # number of fine steps per normal step
        self._finer = math.ceil(settings.time_step / FINE_STEP_S - 1e-9)
        self._substeps = 1
        self._vehicles = [
            _Vehicle(engine, model, robot, settings, i) for i, robot in enumerate(robots)
        ]
        self._turns = list(zip(self._vehicles, share_arrays(robots), strict=True))
        self._walkers = None
        if crowd is not None:
            self._walkers = EngineWalkers(crowd, robots, settings.time_step)
            self._place(self._walkers, self._walkers.places.ravel())

    def observe(self, state: Array) -> None:
        """Fill ``state`` with the true states, and contacts since the last call."""
        for vehicle, share in self._turns:
            vehicle.observe(state[share.state])
        if self._walkers is not None:
            self._walkers.observe(state)

    def sense(self, signals: Array) -> None:
        """Fill ``signals``; range sensors detect other robots but not their own."""
        for vehicle, share in self._turns:
            vehicle.sense(signals[share.signals])

    def advance(self, command: Array, duration: float) -> None:
        """Apply ``command`` for ``duration`` [s], checking contacts after each step."""
        for vehicle, share in self._turns:
            vehicle.take(read_command(command, share))
        step, vehicles, walkers = self._bullet.stepSimulation, self._vehicles, self._walkers
        steps = round(duration / self._time_step)
        ways = None if walkers is None else walkers.move(steps)
        for k in range(steps):
            if walkers is not None and ways is not None:
                self._place(walkers, ways[k])
            if self._model.watched:
                self._adapt_step()
            for _ in range(self._substeps):
                step()
                for vehicle in vehicles:
                    vehicle.report_contact()
                if walkers is not None:
                    self._note_touches(walkers)

    def _place(self, walkers: EngineWalkers, places: Array) -> None:
        for body, index in self._model.walkers.items():
            x, y = places[2 * index : 2 * index + 2].tolist()
            z = walkers.sizes[index][1] / 2.0 + GAP_M
            self._bullet.resetBasePositionAndOrientation(body, (x, y, z), (0, 0, 0, 1))

    def _note_touches(self, walkers: EngineWalkers) -> None:
        for robot, loaded in enumerate(self._model.robots):
            for _, point in find_touches(self._bullet, loaded, self._model.ground):
                if point[2] in self._model.walkers:
                    walkers.touch(self._model.walkers[point[2]], robot)

    def _adapt_step(self) -> None:
        disturbed = any(
            vehicle.disturbs(body) for vehicle in self._vehicles for body in self._model.watched
        )
        substeps = self._finer if disturbed else 1
        if substeps != self._substeps:
            self._substeps = substeps
            self._bullet.setTimeStep(self._time_step / substeps)
            for vehicle in self._vehicles:
                vehicle.adapt_gain(self._time_step / substeps)


class _Vehicle:
    def __init__(
        self, engine: Engine, model: Model, robot: Robot, settings: Settings, index: int
    ) -> None:
        bullet = engine.bullet
        self._bullet, self._model = bullet, model
        self._robot = model.robots[index]
        self._drive, self._lag = robot.drive, settings.steering_lag_s
        self._step = settings.time_step
        self._gap = NEAR_STEPS * robot.drive.max_speed_mps * settings.time_step
        self._reach = self._gap + 2.0 * float(np.linalg.norm(robot.outline, axis=1).max())
        self._command: tuple[float, ...] | None = None
        self._touched = False  # whether a contact has occurred since the last observation
        self._rays, self._ranges = BulletRays(bullet, self._robot, robot), robot.beam_count
        self._signals = BulletSignals(bullet, model, robot, index)

    def observe(self, state: Array) -> None:
        bullet, robot = self._bullet, self._robot
        place, facing = bullet.getBasePositionAndOrientation(robot.body)
        velocity, (_, _, yaw_rate) = bullet.getBaseVelocity(robot.body)
        place, quaternion = bullet.multiplyTransforms(place, facing, *robot.to_base)
        fill_state(state, place, quaternion, velocity, yaw_rate)
        state[CONTACT] = self._touched
        self._touched = False

    def sense(self, signals: Array) -> None:
        self._rays.cast(signals[: self._ranges])
        self._signals.read(signals)

    def take(self, command: tuple[float, ...]) -> None:
        if self._command != command:
            self._command = command
            self._set_motors(command)

    def report_contact(self) -> None:
        if not self._touched:
            self._touched = any(find_touches(self._bullet, self._robot, self._model.ground))
        if self._signals.feels:
            self._signals.feel()

    def adapt_gain(self, step: float) -> None:
        """Adapt the motors, whose gains are per step, to a new time step [s]."""
        self._step = step
        if self._command is not None:
            self._set_motors(self._command)

    def disturbs(self, body: int) -> bool:
        """Return True if a movable body is moving, or if the robot may reach one in this step."""
        bullet, robot = self._bullet, self._robot.body
        if bullet.getBaseVelocity(body) != AT_REST:
            return True
        (x, y, _), _ = bullet.getBasePositionAndOrientation(robot)
        (bx, by, _), _ = bullet.getBasePositionAndOrientation(body)
        reach = self._reach + self._model.watched[body]
        if (bx - x) * (bx - x) + (by - y) * (by - y) > reach * reach:
            return False
        return bool(bullet.getClosestPoints(robot, body, self._gap))

    def _set_motors(self, command: tuple[float, ...]) -> None:
        bullet, robot = self._bullet, self._robot
        angles, rates = find_targets(self._drive, *command)
        if angles:
            # The engine's default gain is constant: a lag of ten steps of any length.
            gain = lag_gain(self._step, self._lag)
            bullet.setJointMotorControlArray(
                robot.body,
                robot.steering,
                bullet.POSITION_CONTROL,
                targetPositions=angles,
                forces=robot.steering_forces,
                positionGains=(gain,) * len(angles),
            )
        bullet.setJointMotorControlArray(
            robot.body,
            robot.wheels,
            bullet.VELOCITY_CONTROL,
            targetVelocities=rates,
            forces=robot.wheel_forces,
        )
