"""What range sensors see in Gazebo: its bodies, set to their places in MuJoCo's model of the world.

The library casts no rays in Debian's version, and NaN with some collision detectors in later ones.
"""

from collections.abc import Sequence

import numpy as np

from evoros.base.arrays import Array
from evoros.robot.model import Robot
from evoros.simulator.engines.mujoco_model import Model
from evoros.simulator.engines.mujoco_sight import MujocoSight
from evoros.simulator.engines.walking import EngineWalkers


class GazeboSight:
    """The range sensors of all robots of ``model``."""

    def __init__(
        self,
        model: Model,
        robots: Sequence[Robot],
        parts: Sequence[tuple[int, slice]],
        bodies: slice,
    ) -> None:
        """Find where answers have what the model's state has.

        ``parts`` has, of each robot, where its pose begins and the angles of its wheels and then of
        its steering; ``bodies`` is where the poses of movable bodies are.
        """
        self._model = model
        self._sights = [MujocoSight(model, robot, i) for i, robot in enumerate(robots)]
        engine = model.model
        firsts = engine.jnt_qposadr[engine.jnt_type == model.library.mjtJoint.mjJNT_FREE].tolist()
        roots = {places.root[0] for places in model.robots}
        to = [np.arange(first, first + 7) for first in firsts if first not in roots]
        source = [np.arange(bodies.start, bodies.stop)]
        for (start, angles), places in zip(parts, model.robots, strict=True):
            first, _ = places.root
            to += [np.arange(first, first + 7), places.wheels, places.steering]
            source += [np.arange(start, start + 7), np.arange(angles.start, angles.stop)]
        self._to, self._source = np.concatenate(to), np.concatenate(source)

    def place(self, values: Array, walkers: EngineWalkers | None) -> None:
        """Set the robots and the movable bodies to their places in an answer, and walkers."""
        model = self._model
        if walkers is not None:
            model.place_walkers(walkers.places)
        model.data.qpos[self._to] = values[self._source]
        model.library.mj_kinematics(model.model, model.data)

    def cast(self, index: int, ranges: Array) -> None:
        """Fill ``ranges`` (n,) [m] of a robot."""
        self._sights[index].cast(ranges)
