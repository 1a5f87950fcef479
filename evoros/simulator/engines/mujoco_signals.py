"""The signals of sensors that cast no rays in MuJoCo."""

import numpy as np

from evoros.base.arrays import Array
from evoros.base.linear import product
from evoros.robot.model import Robot
from evoros.simulator.engines.mujoco_bodies import GROUND
from evoros.simulator.engines.mujoco_model import Model
from evoros.simulator.engines.mujoco_rays import root_frame
from evoros.simulator.engines.rigid_signals import Motion, RigidSignals


class MujocoSignals(RigidSignals):
    """The signals of one of the robots of ``model``."""

    def __init__(self, model: Model, robot: Robot, index: int) -> None:
        engine, data, parts = model.model, model.data, model.robots[index]
        super().__init__(robot, -float(engine.opt.gravity[2]))
        self._data = data
        # All but the ground and itself can touch this robot.
        self._ours = np.isin(np.arange(engine.ngeom), parts.visible)
        self._theirs = (engine.geom_group != GROUND) & ~self._ours
        position, rate = parts.root
        self._pose, self._rates = data.qpos[position : position + 7], data.qvel[rate : rate + 6]
        self._angles = parts.wheels

    def read(self, signals: Array) -> None:
        """Write all signals into their parts."""
        if self.exist:
            rotation, position = root_frame(self._pose)
            # The turning is about the link's own axes.
            motion = Motion(position, rotation, self._rates[:3], product(rotation, self._rates[3:]))
            self.fill(signals, motion, self._data.qpos[self._angles])

    def feel(self) -> None:
        """Count a step in which the robot touches something, in the zones that it touches with."""
        contact = self._data.contact
        ours, theirs = self._ours[contact.geom], self._theirs[contact.geom]
        felt = (ours & theirs[:, ::-1]).any(axis=1)
        if not felt.any():
            return
        rotation, position = root_frame(self._pose)
        points = (product(contact.pos[felt] - position, rotation))[:, :2]
        pairs = contact.geom[felt]
        self.touch(points[(pairs == pair).all(axis=1)] for pair in np.unique(pairs, axis=0))
