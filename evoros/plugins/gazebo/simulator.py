"""Rigid-body physics with Gazebo's library and DART, in a separate process.

Rays are cast in a MuJoCo model, because Gazebo's ray casting is missing or returns NaN.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from itertools import groupby
from typing import Annotated

import numpy as np

from evoros.base.arrays import CONTACT, Array
from evoros.base.checks import LEAST_STEP_S, NOT_NEGATIVE, POSITIVE, checked, number_between
from evoros.base.errors import InputError, LaunchError
from evoros.drive.protocol import Drive, find_targets
from evoros.geometry.shapes import Pose, normalize
from evoros.plugins.gazebo.gazebo_world import hold_standing
from evoros.plugins.gazebo.server import Engine, Operation, Scene, compile_server, find_library
from evoros.robot.model import Robot
from evoros.simulator.engines import teams
from evoros.simulator.engines.idle import IdleEngines
from evoros.simulator.engines.mujoco_model import Model, Models, Settings, count_movable
from evoros.simulator.engines.mujoco_rays import MujocoSight
from evoros.simulator.engines.rigid_signals import Motion, RigidSignals, fill_state
from evoros.simulator.engines.walking import EngineWalkers
from evoros.simulator.mujoco import import_mujoco
from evoros.simulator.protocol import PlacedRobot
from evoros.walkers.crowd import has_touched
from evoros.world.model import World


class GazeboSight:
    """The range sensors of all robots, in the MuJoCo ``model``."""

    def __init__(
        self,
        model: Model,
        robots: Sequence[Robot],
        parts: Sequence[tuple[int, slice]],
        bodies: slice,
    ) -> None:
        """Prepare to copy poses from the server's answers to the MuJoCo model.

        ``parts`` holds, for each robot, the index of its pose in an answer, and the slice of its
        wheel and steering angles. ``bodies`` is the slice of the poses of movable bodies.
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
        """Move robots, movable bodies and walkers to the poses in an answer."""
        model = self._model
        if walkers is not None:
            model.place_walkers(walkers.places)
        model.data.qpos[self._to] = values[self._source]
        model.library.mj_kinematics(model.model, model.data)

    def cast(self, index: int, ranges: Array) -> None:
        """Fill the ranges (n,) [m] of a robot."""
        self._sights[index].cast(ranges)


POSE, VELOCITY, TURNING, TOUCHED, ANGLES = slice(7), slice(7, 10), slice(10, 13), 13, 14
"""A robot in an answer: pose of the root link (x, y, z, w, i, j, k), velocity [m/s], angular
velocity [rad/s], 1 after a contact since the last answer, wheel and steering angles [rad].
"""
BODY_SIZE = 7  # number of values in a movable body's pose
ROBOT, STEP, SHAPE, OTHER, AT = 0, 1, 2, 3, slice(4, 6)
"""Columns of a contact: robot, step, both shapes, and x, y [m] in the robot's frame."""
FELT_SIZE = 6


class GazeboSimulation:
    """The simulated robots of ``scene`` in a world."""

    def __init__(
        self,
        scene: Scene,
        rays: Model | None,
        robots: Sequence[Robot],
        world: World,
        settings: Settings,
    ) -> None:
        self._server, self._number, self.values = scene
        self._time_step = settings.time_step
        self._time = 0.0  # mission time [s]
        self._vehicles = []
        start = 0
        for robot in robots:
            self._vehicles.append(Vehicle(robot, start, world.gravity_mps2))
            start = self._vehicles[-1].end
        self._bodies = slice(start, start + BODY_SIZE * count_movable(world))
        self._walkers, walkers = None, 0
        if world.crowd is not None:
            self._walkers = EngineWalkers(world.crowd, robots, settings.time_step)
            walkers = len(world.crowd.names)
        self._touches = slice(self._bodies.stop, self._bodies.stop + walkers)
        self._sight = None
        if rays is not None:
            starts = [(v.start, v.angles) for v in self._vehicles]
            self._sight = GazeboSight(rays, robots, starts, self._bodies)
        self._turns = list(zip(self._vehicles, teams.share_arrays(robots), strict=True))
        self._feels = any(vehicle.signals.feels for vehicle in self._vehicles)
        self._commands = np.zeros(sum(vehicle.joints for vehicle in self._vehicles))

    @property
    def bodies(self) -> Array:
        """The poses (n, 7) of movable bodies: x, y, z, w, i, j, k."""
        return self.values[self._bodies].reshape(-1, BODY_SIZE)

    def observe(self, state: Array) -> None:
        """Fill ``state`` with the true states, including any contact since the last call."""
        for vehicle, share in self._turns:
            vehicle.observe(self.values, state[share.state])
        if self._walkers is not None:
            self._walkers.observe(state)

    def sense(self, signals: Array) -> None:
        """Fill ``signals``; range sensors see other robots, but not their own."""
        if self._sight is not None:
            self._sight.place(self.values, self._walkers)
        for index, (vehicle, share) in enumerate(self._turns):
            own = signals[share.signals]
            if self._sight is not None:
                self._sight.cast(index, own[: vehicle.ranges])
            vehicle.read(self.values, own)

    def advance(self, command: Array, duration: float) -> None:
        """Apply ``command`` for ``duration`` [s]; record even contacts of a single step."""
        at = 0
        for vehicle, share in self._turns:
            part = self._commands[at : at + vehicle.joints]
            vehicle.follow(teams.read_command(command, share), part)
            at += vehicle.joints
        steps = round(duration / self._time_step)
        body = self._commands.tobytes()
        if self._walkers is not None:
            body += self._walkers.move(steps).tobytes()
        self.values = self._server.ask(
            Operation.ADVANCE, self._number, body, steps, self._feels, self._time
        )
        self._time += duration
        for vehicle in self._vehicles:
            vehicle.note_touch(self.values)
        if self._feels:
            self._feel(self.values[self._touches.stop :].reshape(-1, FELT_SIZE))
        if self._walkers is not None:
            for walker, touched in enumerate(self.values[self._touches].tolist()):
                for robot in range(len(self._vehicles)):
                    if has_touched(touched, robot):
                        self._walkers.touch(walker, robot)

    def _feel(self, contacts: Array) -> None:
        rows = contacts.tolist()
        for index, vehicle in enumerate(self._vehicles):
            own = [row for row in rows if row[ROBOT] == index]
            for _, touches in groupby(own, key=lambda row: row[STEP]):
                pairs: dict[tuple[float, float], list[list[float]]] = {}
                for row in touches:
                    pairs.setdefault((row[SHAPE], row[OTHER]), []).append(row[AT])
                vehicle.signals.touch(np.array(points) for points in pairs.values())


class Vehicle:
    """A robot with values in each answer from index ``start``."""

    def __init__(self, robot: Robot, start: int, gravity: float) -> None:
        self._drive, self.start, self.ranges = robot.drive, start, robot.beam_count
        self._wheels = len(robot.drive.wheel_joints)
        self.joints = self._wheels + len(robot.drive.steering_joints)
        self.end = start + ANGLES + self.joints
        self.angles = slice(start + ANGLES, self.end)
        self._motion = slice(start, start + TOUCHED)
        self._command: tuple[float, ...] | None = None
        self._targets = np.zeros(self.joints)
        self._touched = False  # whether a contact has occurred since the last observation
        self.signals = RigidSignals(robot, gravity)

    def observe(self, values: Array, state: Array) -> None:
        """Fill ``state`` from an answer, including any contact since the last call."""
        motion = values[self._motion].tolist()
        x, y, _, qw, qx, qy, qz, vx, vy, _, _, _, yaw_rate = motion
        fill_state(state, (x, y), (qx, qy, qz, qw), (vx, vy), yaw_rate)
        state[CONTACT] = self._touched
        self._touched = False

    def read(self, values: Array, signals: Array) -> None:
        """Write the readings of all sensors except range sensors into ``signals``."""
        if self.signals.exist:
            own = values[self.start : self.end]
            x, y, z, qw, qx, qy, qz = own[POSE].tolist()
            rotation = Pose((x, y, z), normalize((qx, qy, qz, qw))).rotation
            motion = Motion(np.array([x, y, z]), rotation, own[VELOCITY], own[TURNING])
            self.signals.fill(signals, motion, own[ANGLES:][: self._wheels].tolist())

    def follow(self, command: tuple[float, ...], targets: Array) -> None:
        """Write the wheel rates [rad/s] and steering angles [rad] of a command into ``targets``."""
        if self._command != command:
            self._command = command
            angles, rates = find_targets(self._drive, *command)
            self._targets[:] = (*rates, *angles)
        targets[:] = self._targets

    def note_touch(self, values: Array) -> None:
        """Store a contact for the next observation."""
        self._touched = self._touched or values[self.start + TOUCHED] > 0.0


MAX_STEP_S = 0.025  # maximum step [s] for motion within 1 % of the kinematics (docs/fidelity.md)

MOST_MOVABLE = 500  # maximum number of movable bodies; each takes DART 25 us per step

_RAYS = Settings(time_step=0.01, wheel_friction=1.0, steering_lag_s=0.0)  # nothing moves on its own

IDLE: IdleEngines[Engine] = IdleEngines()


@dataclass(frozen=True)
@checked
class Gazebo(teams.TeamSimulator):
    """The simulator that uses Gazebo's physics."""

    time_step: Annotated[float, number_between(LEAST_STEP_S, MAX_STEP_S)] = 0.005  # [s]
    wheel_friction: Annotated[float, POSITIVE] = 1.0  # limited by the friction of the ground
    steering_lag_s: Annotated[float, NOT_NEGATIVE] = 0.05  # time constant of the servos
    answer_limit_s: Annotated[float, POSITIVE] = 60.0  # [s] per control period, or to open a world
    versions: Mapping[str, str] = field(
        init=False, compare=False, default_factory=lambda: find_library().versions
    )
    """Versions of the system libraries on this machine, which workers elsewhere must match."""
    packages = ("mujoco-core",)

    def _require_versions(self) -> None:
        try:
            found = find_library().versions
        except InputError as error:
            raise LaunchError(str(error)) from error
        for name, version in self.versions.items():
            if found.get(name) != version:
                raise LaunchError(
                    f"simulator=gazebo: a worker has {name} {found.get(name) or '(none)'}, but the "
                    f"main process has {version}; install the same release there"
                )

    def check_world(self, world: World) -> None:
        """Reject worlds with too many movable bodies."""
        count = count_movable(hold_standing(world, robots=1))
        if count > MOST_MOVABLE:
            raise InputError(
                f"must have at most {MOST_MOVABLE} movable bodies with simulator=gazebo, not "
                f"{count}, because Gazebo simulates all of them in every step; make some bodies "
                f"static, or use simulator=mujoco"
            )

    def doubt_drive(self, drive: Drive) -> str:
        """Return why skid steering is inaccurate at any time step, or ""."""
        return teams.doubt_skidding("Gazebo's DART", drive)

    @contextmanager
    def open(self, robots: Sequence[PlacedRobot], world: World) -> Iterator[GazeboSimulation]:
        """Open a simulation with each robot at its home pose."""
        teams.check_number(robots)
        self._require_versions()
        settings = Settings(self.time_step, self.wheel_friction, self.steering_lag_s)
        held = hold_standing(world, len(robots)).with_crowd(world.crowd)
        alone = [robot for robot, _ in robots]
        sees = any(robot.beam_count for robot in alone)
        rays = _models().prepare(robots, held, _RAYS) if sees else None
        with IDLE.take(lambda: Engine(compile_server(), self.answer_limit_s)) as engine:
            engine.limit(self.answer_limit_s)
            scene = engine.prepare(robots, held, settings)
            yield GazeboSimulation(scene, rays, alone, held, settings)


@cache
def _models() -> Models:
    return Models(import_mujoco())
