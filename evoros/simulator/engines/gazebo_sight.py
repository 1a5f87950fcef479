"""What range sensors see in Gazebo: its bodies, set to their places in MuJoCo's model of the world.

The library casts no rays in Debian's version, and NaN with some collision detectors in later ones.
"""

from collections.abc import Sequence

import numpy as np

from evoros.base.arrays import Array
from evoros.robot.model import Robot
from evoros.simulator.engines.mujoco_model import Model
from evoros.simulator.engines.mujoco_sight import MujocoSight


class GazeboSight:
    """The range sensors of all robots of ``model``."""

    def __init__(self, model: Model, robots: Sequence[Robot]) -> None:
        self._model = model
        self._sights = [MujocoSight(model, robot, i) for i, robot in enumerate(robots)]
        engine = model.model
        firsts = engine.jnt_qposadr[engine.jnt_type == model.library.mjtJoint.mjJNT_FREE].tolist()
        roots = {parts.root[0] for parts in model.robots}
        bodies = [np.arange(first, first + 7) for first in firsts if first not in roots]
        self._bodies = np.array(bodies, dtype=int).reshape(-1, 7)

    def place(self, robots: Sequence[tuple[Array, Array]], bodies: Array) -> None:
        """Set the robots, by poses (7,) and joints' angles [rad], and the movable bodies (n, 7)."""
        model = self._model
        places = model.data.qpos
        for (pose, angles), parts in zip(robots, model.robots, strict=True):
            first, _ = parts.root
            places[first : first + 7] = pose
            places[parts.wheels] = angles[: len(parts.wheels)]
            places[parts.steering] = angles[len(parts.wheels) :]
        places[self._bodies] = bodies
        model.library.mj_kinematics(model.model, model.data)

    def cast(self, index: int, ranges: Array) -> None:
        """Fill ``ranges`` (n,) [m] of a robot."""
        self._sights[index].cast(ranges)
