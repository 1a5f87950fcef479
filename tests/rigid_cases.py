"""The rigid-body engines behind one set of questions, for the tests that all must pass."""

import math
from importlib import import_module
from typing import Any, Protocol

import numpy as np
import pytest

from evoros.base.arrays import Array
from evoros.files.plugins import find_plugins
from evoros.geometry.shapes import Pose
from evoros.robot.model import Robot
from evoros.simulator.engines.pybullet_bodies import wake
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import open_alone
from evoros.simulator.pybullet import PyBullet
from evoros.world.model import World

Rigid = PyBullet | Mujoco
RIGID: dict[str, type[Rigid]] = {"pybullet": PyBullet, "mujoco": Mujoco}
if "gazebo" in find_plugins():  # its engine has the settings that they have
    RIGID["gazebo"] = import_module("evoros.plugins.gazebo.simulator").Gazebo
MARKS = {"gazebo": [pytest.mark.gz_physics]}
"""Gazebo's engine needs packages of the system."""
ENGINES = [
    pytest.param(engine, id=name, marks=MARKS.get(name, ())) for name, engine in RIGID.items()
]
"""The engines as parameters of a test."""
STEPS = (0.0025, 0.005, 0.01, 0.02, 0.025)
"""Time steps [s] that every engine takes."""


class Probe(Protocol):
    """The questions of tests to an engine, besides a mission's."""

    def base(self) -> Pose:
        """The pose of the robot's root link."""

    def movable(self) -> list[Pose]:
        """The poses of the bodies that can be pushed, in the order of the world."""

    def push(self, force: float) -> None:
        """Push the first of these along x [N] in the next step."""

    def throw(self, speed: float) -> None:
        """Let the first of these move along x [m/s]."""

    def wake(self) -> None:
        """Let all bodies that can be pushed move."""

    def speeds(self) -> list[float]:
        """The speeds [m/s] of the bodies that can be pushed."""

    def angle(self, joint: str) -> float:
        """The angle [rad] of a joint."""

    def height(self, x: float, y: float) -> float:
        """The height [m] of what a ray from above hits first, but for the robot."""

    def moments(self) -> list[float]:
        """The moments of inertia [kg m2] of the first body that can be pushed, about its axes."""


def probe(simulation: Any) -> Probe:
    if hasattr(simulation, "_server"):
        from evoros.plugins.gazebo.tests.gazebo_probe import GazeboProbe

        return GazeboProbe(simulation)
    return BulletProbe(simulation) if hasattr(simulation, "_bullet") else MujocoProbe(simulation)


class BulletProbe:
    def __init__(self, simulation: Any) -> None:
        self.bullet = simulation._bullet
        self.model = simulation._model

    def base(self) -> Pose:
        robot = self.model.robots[0]
        pose = self.bullet.getBasePositionAndOrientation(robot.body)
        return Pose(*self.bullet.multiplyTransforms(*pose, *robot.to_base))

    def movable(self) -> list[Pose]:
        numbers = list(self.model.movable)
        return [Pose(*self.bullet.getBasePositionAndOrientation(n)) for n in numbers]

    def push(self, force: float) -> None:
        bullet, body = self.bullet, next(iter(self.model.movable))
        awake = bullet.ACTIVATION_STATE_WAKE_UP
        bullet.changeDynamics(body, -1, activationState=awake)
        at, frame = (0, 0, 0), bullet.LINK_FRAME
        bullet.applyExternalForce(body, -1, (force, 0, 0), at, frame)

    def throw(self, speed: float) -> None:
        body = next(iter(self.model.movable))
        wake(self.bullet, body)
        self.bullet.resetBaseVelocity(body, (speed, 0.0, 0.0), (0.0, 0.0, 0.0))

    def wake(self) -> None:
        for body in self.model.movable:
            wake(self.bullet, body)

    def speeds(self) -> list[float]:
        rates = (self.bullet.getBaseVelocity(n)[0] for n in self.model.movable)
        return [math.hypot(*rate) for rate in rates]

    def angle(self, joint: str) -> float:
        body = self.model.robots[0].body
        for index in self.model.robots[0].joints:
            if self.bullet.getJointInfo(body, index)[1].decode() == joint:
                return float(self.bullet.getJointState(body, index)[0])
        raise KeyError(joint)

    def height(self, x: float, y: float) -> float:
        (hit,) = self.bullet.rayTest([x, y, 9.0], [x, y, -9.0], collisionFilterMask=4 | 8 | 16)
        return 9.0 - 18.0 * float(hit[2])

    def moments(self) -> list[float]:
        body = next(iter(self.model.movable))
        return list(self.bullet.getDynamicsInfo(body, -1)[2])


class MujocoProbe:
    def __init__(self, simulation: Any) -> None:
        self.model, self.data = simulation._model.model, simulation._model.data
        self.library = simulation._model.library

    def base(self) -> Pose:
        return self._pose(self.model.joint("evoros root").qposadr[0])

    def _pose(self, first: int) -> Pose:
        x, y, z, qw, qx, qy, qz = self.data.qpos[first : first + 7].tolist()
        return Pose((x, y, z), (qx, qy, qz, qw))

    def movable(self) -> list[Pose]:
        root = self.model.joint("evoros root").id
        free = np.flatnonzero(self.model.jnt_type == self.library.mjtJoint.mjJNT_FREE)
        return [self._pose(self.model.jnt_qposadr[joint]) for joint in free if joint != root]

    def _first(self) -> int:
        free = np.flatnonzero(self.model.jnt_type == self.library.mjtJoint.mjJNT_FREE)
        root = self.model.joint("evoros root").id
        return int(self.model.jnt_bodyid[next(joint for joint in free if joint != root)])

    def push(self, force: float) -> None:
        self.data.xfrc_applied[self._first(), 0] = force

    def throw(self, speed: float) -> None:
        self.data.qvel[self.model.body_dofadr[self._first()]] = speed

    def wake(self) -> None:
        """The engine lets all bodies settle before they sleep."""

    def speeds(self) -> list[float]:
        root = self.model.joint("evoros root").id
        free = np.flatnonzero(self.model.jnt_type == self.library.mjtJoint.mjJNT_FREE)
        first = [self.model.jnt_dofadr[joint] for joint in free if joint != root]
        return [math.hypot(*self.data.qvel[i : i + 3].tolist()) for i in first]

    def moments(self) -> list[float]:
        assert self.model.body_iquat[self._first()].tolist() == [1.0, 0.0, 0.0, 0.0]
        return list(self.model.body_inertia[self._first()].tolist())

    def angle(self, joint: str) -> float:
        return float(self.data.joint(joint).qpos[0])

    def height(self, x: float, y: float) -> float:
        library, seen = self.library, np.zeros(1, dtype=np.int32)
        library.mj_forward(self.model, self.data)
        seen_groups = np.array([1, 1, 1, 0, 0, 0], dtype=np.uint8)
        down = np.array([0.0, 0.0, -1.0])
        at = np.array([x, y, 9.0])
        return 9.0 - float(
            library.mj_ray(self.model, self.data, at, down, seen_groups, True, -1, seen)
        )


def attitude(simulation: Any) -> tuple[float, float, float]:
    """Height [m], roll and pitch [deg], nose down positive, of the root link."""
    pose = probe(simulation).base()
    turn = pose.rotation
    pitch = math.asin(min(max(-float(turn[2, 0]), -1.0), 1.0))
    roll = math.atan2(float(turn[2, 1]), float(turn[2, 2]))
    return pose.position[2], math.degrees(roll), math.degrees(pitch)


def ranges(simulator: Rigid | Planar, robot: Robot, world: World, settle: float = 0.0) -> Array:
    """The readings of the sensors, ``settle`` [s] after the start."""
    readings = np.zeros(len(robot.mounts))
    with open_alone(simulator.open, robot, world) as simulation:
        if settle:
            simulation.advance(np.zeros(2), settle)
        simulation.sense(readings)
    return readings
