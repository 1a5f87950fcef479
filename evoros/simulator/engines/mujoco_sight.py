"""What the range sensors of one of several robots see in MuJoCo's model of a world."""

import numpy as np

from evoros.base.arrays import Array
from evoros.robot.model import Robot
from evoros.simulator.engines.mujoco_bodies import MOVABLE, ROBOT
from evoros.simulator.engines.mujoco_model import Model
from evoros.simulator.engines.mujoco_rays import MujocoRays


class MujocoSight:
    """The range sensors of a robot, which sees the others and not itself."""

    def __init__(self, model: Model, robot: Robot, index: int) -> None:
        self._groups, self._data = model.model.geom_group, model.data
        parts = model.robots[index]
        self._steering, (first, _) = parts.steering, parts.root
        self._pose = model.data.qpos[first : first + 7]
        self._rays = MujocoRays(model, robot)
        rest = [other.visible for i, other in enumerate(model.robots) if i != index]
        self._others = np.concatenate([np.zeros(0, dtype=int), *rest])  # the other robots' shapes

    def cast(self, ranges: Array) -> None:
        """Fill ``ranges`` (n,) [m], if all shapes are where their links are."""
        self._groups[self._others] = MOVABLE
        self._rays.cast(self._pose, ranges)
        if self._rays.parts.exist:
            self._rays.cast_at_parts(self._data.qpos[self._steering], ranges)
        self._groups[self._others] = ROBOT
