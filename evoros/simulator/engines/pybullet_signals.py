"""The signals of sensors that cast no rays in PyBullet."""

from collections.abc import Collection, Iterator
from typing import Any

import numpy as np

from evoros.base.arrays import Array
from evoros.base.linear import product
from evoros.robot.model import Robot
from evoros.simulator.engines.pybullet_model import Model
from evoros.simulator.engines.pybullet_robot import LoadedRobot
from evoros.simulator.engines.rigid_signals import Motion, RigidSignals


class BulletSignals(RigidSignals):
    """The signals of one of the robots of ``model``."""

    def __init__(self, bullet: Any, model: Model, robot: Robot, index: int) -> None:
        self._bullet = bullet
        self._ground, self._robot = model.ground, model.robots[index]
        settings = bullet.getPhysicsEngineParameters()
        super().__init__(robot, -float(settings["gravityAccelerationZ"]))

    def read(self, signals: Array) -> None:
        """Write all signals into their parts."""
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
        """Count a step in which the robot touches something, in the zones that it touches with."""
        touches: dict[tuple[int, int, int], list[Any]] = {}  # by link, other body and its link
        for link, point in find_touches(self._bullet, self._robot, self._ground):
            touches.setdefault((link, point[2], point[4]), []).append(point[5])
        if touches:
            position, rotation, *_ = self._find_motion()
            pieces = (product(np.array(points) - position, rotation) for points in touches.values())
            self.touch(points[:, :2] for points in pieces)


def find_touches(
    bullet: Any, robot: LoadedRobot, ground: Collection[int]
) -> Iterator[tuple[int, Any]]:
    """Yield the contacts of a robot with obstacles: its link and the engine's contact point.

    The engine lists points of all bodies that are near. Points with a force or an overlap touch.
    """
    for link in robot.touching:
        for point in bullet.getContactPoints(robot.body, -1, link, -2):
            if point[2] not in ground and (point[8] <= 0.0 or point[9] > 0.0):
                yield link, point
