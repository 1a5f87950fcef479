"""One mission's dealings with PyBullet: observe, sense, advance."""

import math
from typing import Any

import numpy as np

from evoros.base.arrays import CONTACT, DRIVE_SPEED, SPEED, STEERING, YAW, YAW_RATE, Array, X, Y
from evoros.robot.model import Robot
from evoros.simulator.engines.pybullet_model import SEEN, Model, Settings

MOST_RAYS = 16_383  # that one call of rayTestBatch takes


class PyBulletSimulation:
    """The robot of ``model`` in its world.

    The calls of the engine are bound once: looking them up costs as much as some of them.
    """

    def __init__(
        self, bullet: Any, client: int, model: Model, robot: Robot, settings: Settings
    ) -> None:
        self._bullet, self._client, self._model = bullet, client, model
        self._drive, self._time_step = robot.drive, settings.time_step
        self._gains = (_gain(settings),) * len(model.steering)
        self._command: tuple[float, float] | None = None
        self._touched = False  # since the last observation
        self._beams = _beams(robot, bullet, model)

    def observe(self, state: Array) -> None:
        """The true state, of the base link; contact with an obstacle since the last call."""
        bullet, client, model = self._bullet, self._client, self._model
        position, facing = bullet.getBasePositionAndOrientation(model.body, client)
        (vx, vy, _), (_, _, yaw_rate) = bullet.getBaseVelocity(model.body, client)
        (x, y, _), (qx, qy, qz, qw) = bullet.multiplyTransforms(position, facing, *model.to_base)
        yaw = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        state[X], state[Y], state[YAW], state[YAW_RATE] = x, y, yaw, yaw_rate
        state[SPEED] = vx * math.cos(yaw) + vy * math.sin(yaw)
        state[CONTACT] = self._touched
        self._touched = False

    def _touches(self) -> bool:
        """Contact points come with bodies that are near; touching is a force or an overlap."""
        body, client = self._model.body, self._client
        for link in self._model.touching:
            for point in self._bullet.getContactPoints(body, -1, link, -2, client):
                if point[2] not in self._model.ground and (point[8] <= 0.0 or point[9] > 0.0):
                    return True
        return False

    def sense(self, readings: Array) -> None:
        """The nearest hit of each sensor's rays [m], within the sensor's range."""
        sensor = 0
        for starts, ends, beams in self._beams:
            hits = self._bullet.rayTestBatch(
                starts,
                ends,
                parentObjectUniqueId=self._model.body,
                parentLinkIndex=-1,
                collisionFilterMask=SEEN,
                physicsClientId=self._client,
            )
            fractions = [hit[2] for hit in hits]
            for first, last, low, high in beams:
                reading = high * min(fractions[first:last])
                readings[sensor] = reading if reading > low else low
                sensor += 1

    def advance(self, command: Array, duration: float) -> None:
        """Step the engine; motors are told only what has changed.

        Contacts are looked at after every step: a touch may be shorter than a control period.
        """
        speed, steering = float(command[DRIVE_SPEED]), float(command[STEERING])
        if self._command != (speed, steering):
            self._command = (speed, steering)
            self._set_motors(speed, steering)
        step, client = self._bullet.stepSimulation, self._client
        for _ in range(round(duration / self._time_step)):
            step(client)
            if not self._touched and self._touches():
                self._touched = True

    def _set_motors(self, speed: float, steering: float) -> None:
        bullet, model = self._bullet, self._model
        angles, rates = self._drive.targets(speed, steering)
        if angles:
            bullet.setJointMotorControlArray(
                model.body,
                model.steering,
                bullet.POSITION_CONTROL,
                targetPositions=angles,
                forces=model.steering_forces,
                positionGains=self._gains,
                physicsClientId=self._client,
            )
        bullet.setJointMotorControlArray(
            model.body,
            model.wheels,
            bullet.VELOCITY_CONTROL,
            targetVelocities=rates,
            forces=model.wheel_forces,
            physicsClientId=self._client,
        )


def _gain(settings: Settings) -> float:
    """The share of a steering error that is made up in one step.

    The engine's own constant share would make the lag one of ten steps, however long they are.
    """
    if settings.steering_lag_s == 0.0:
        return 1.0
    return -math.expm1(-settings.time_step / settings.steering_lag_s)


Beam = tuple[int, int, float, float]  # first ray, behind the last, least and greatest range [m]


def _beams(
    robot: Robot, bullet: Any, model: Model
) -> list[tuple[list[list[float]], list[list[float]], list[Beam]]]:
    """Rays in the frame of the chassis' centre of mass, in batches that the engine takes."""
    position, quaternion = model.to_base
    to_base = np.array(bullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)
    batches: list[tuple[list[list[float]], list[list[float]], list[Beam]]] = []
    for mount, frame in zip(robot.mounts, robot.sensor_frames(), strict=True):
        sensor = robot.sensors[mount.sensor]
        origin = to_base @ frame[:3, 3] + position
        ends = origin + sensor.range_max_m * (sensor.rays() @ (to_base @ frame[:3, :3]).T)
        if not batches or len(batches[-1][0]) + len(ends) > MOST_RAYS:
            batches.append(([], [], []))
        starts, stops, beams = batches[-1]
        beams.append((len(starts), len(starts) + len(ends), sensor.range_min_m, sensor.range_max_m))
        starts.extend([origin.tolist()] * len(ends))
        stops.extend(ends.tolist())
    return batches
