"""A PyBullet client that builds or resets models of robots in a world."""

import ctypes
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from inspect import isroutine
from typing import Any, NamedTuple

from evoros.base.errors import InputError, SimulationError, single_line
from evoros.drive.protocol import skids
from evoros.simulator.engines import pybullet_bodies as bodies
from evoros.simulator.engines.pybullet_robot import Groups, LoadedRobot, load_robot
from evoros.simulator.engines.teams import Frame, describe_for_engine, home_frame, sum_others
from evoros.simulator.protocol import PlacedRobot
from evoros.world.model import World


@cache
def import_pybullet() -> Any:
    """Import the pybullet module without its start-up message."""
    try:
        with quiet():
            import pybullet
    except ImportError as error:
        raise not_installed() from error
    return pybullet


class Client:
    """A connection to PyBullet, with the module's functions bound to it."""

    def __init__(self, library: Any) -> None:
        self._library, self._id = library, library.connect(library.DIRECT)

    def __getattr__(self, name: str) -> Any:
        attribute = getattr(self._library, name)
        if isroutine(attribute):
            attribute = partial(attribute, physicsClientId=self._id)
        setattr(self, name, attribute)  # later uses need no lookup
        return attribute


def not_installed() -> InputError:
    """Return the error for an environment without PyBullet."""
    return InputError(
        "simulator=pybullet: PyBullet is not installed, and PyPI has wheels only for Python up to "
        "3.11; use simulator=physics, install evoros with Python 3.11, or build PyBullet with "
        "`pip install pybullet` and a C++ compiler"
    )


@contextmanager
def quiet() -> Iterator[None]:
    """Suppress all terminal output, including output of C code."""
    libc = ctypes.CDLL(None)
    libc.fflush(None)
    saved = [(os.dup(descriptor), descriptor) for descriptor in (1, 2)]
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        for _, descriptor in saved:
            os.dup2(null, descriptor)
        yield
    finally:
        libc.fflush(None)
        for copy, descriptor in saved:
            os.dup2(copy, descriptor)
            os.close(copy)
        os.close(null)


LIFT_M = 1000.0  # height [m] at which robots are far from all bodies
AT_REST = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))  # linear and angular velocity of a body


class Settings(NamedTuple):
    """Engine settings that do not depend on the robots or the world."""

    time_step: float  # [s]
    solver_iterations: int
    wheel_friction: float
    steering_lag_s: float


@dataclass(frozen=True)
class Model:
    """The bodies loaded into the engine."""

    robots: tuple[LoadedRobot, ...]
    ground: frozenset[int]  # ids of bodies that are not obstacles
    movable: Mapping[int, Frame]  # initial frame of each movable body, by id
    falling: tuple[int, ...]  # ids of movable bodies without support
    watched: Mapping[int, float]  # radius [m] of each body that requires fine steps, by id
    walkers: Mapping[int, int]  # index in the crowd of each walker, by id


class Engine:
    """A PyBullet client and its current model."""

    def __init__(self, library: Any) -> None:
        self.bullet = Client(library)
        self._built_from: tuple[Any, ...] | None = None
        self._model: Model | None = None

    def close(self) -> None:
        """Disconnect from PyBullet, after which the engine is unusable."""
        self.bullet.disconnect()

    def forget(self) -> None:
        """Discard the built model, so that the next mission builds a new one."""
        self._built_from = None

    def prepare(self, robots: Sequence[PlacedRobot], world: World, settings: Settings) -> Model:
        """Return the model in its initial state, reset if possible, otherwise rebuilt."""
        described = tuple((*describe_for_engine(robot), home) for robot, home in robots)
        surroundings = world.bodies, world.gravity_mps2, world.course.end_on_collision
        source = described, surroundings, settings, _list_sizes(world)
        if self._model is None or self._built_from != source or self._disturbed(self._model):
            self._built_from = None
            try:
                self._model = self._build(robots, world, settings)
            except self.bullet.error as error:
                raise SimulationError(
                    f"PyBullet cannot build the world {world.name!r} ({single_line(error)}); try "
                    f"simulator=mujoco"
                ) from error
            self._built_from = source
        self.bullet.setTimeStep(settings.time_step)  # a mission may have reduced the step
        self._reset(self._model.robots)
        for body in self._model.falling:
            bodies.wake(self.bullet, body)
        return self._model

    def _disturbed(self, model: Model) -> bool:
        """Return True if any body is unsupported or has moved since the model was built."""
        bullet = self.bullet
        return bool(model.falling) or any(
            bullet.getBasePositionAndOrientation(body) != frame
            or bullet.getBaseVelocity(body) != AT_REST
            for body, frame in model.movable.items()
        )

    def _reset(self, robots: Sequence[LoadedRobot]) -> None:
        """Place the robots at rest at home, after a step while lifted, which ends old contacts."""
        for index, robot in enumerate(robots):
            self._place(robot, LIFT_M * (index + 1))
        self.bullet.stepSimulation()
        for robot in robots:
            self._place(robot, 0.0)

    def _place(self, robot: LoadedRobot, lift: float) -> None:
        bullet = self.bullet
        (x, y, z), facing = robot.start
        bullet.resetBasePositionAndOrientation(robot.body, (x, y, z + lift), facing)
        bullet.resetBaseVelocity(robot.body, (0, 0, 0), (0, 0, 0))
        for joint in robot.joints:
            bullet.resetJointState(robot.body, joint, 0, 0)

    def _build(self, robots: Sequence[PlacedRobot], world: World, settings: Settings) -> Model:
        bullet = self.bullet
        bullet.resetSimulation()
        bullet.setGravity(0, 0, -world.gravity_mps2)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=settings.time_step,
            numSolverIterations=settings.solver_iterations,
            enableFileCaching=0,  # cached files would load an old geometry
            deterministicOverlappingPairs=1,
            collisionFilterMode=0,  # otherwise, the mask of one body suffices for a collision
        )
        if any(skids(robot.drive) for robot, _ in robots):
            # The default friction of the engine on a sliding wheel does not oppose the slip.
            bullet.setPhysicsEngineParameter(enableConeFriction=0)
        added = [(i, body) for body in world.bodies for i in bodies.add_body(bullet, body)]
        movable = {body_id: body for body_id, body in added if body.mass is not None}
        frames = {body_id: bullet.getBasePositionAndOrientation(body_id) for body_id in movable}
        ground = frozenset(body_id for body_id, body in added if body.is_ground)
        falling = bodies.find_falling(bullet, world, movable)
        # A mission that ends at its first contact pushes nothing.
        pushing = falling or not world.course.end_on_collision
        watched = {i: bodies.measure_radius(bullet, i) for i in movable if pushing}
        loaded = tuple(self._load(robots, index, world, settings) for index in range(len(robots)))
        sizes = _list_sizes(world)
        walkers = {bodies.add_walker(bullet, *size): index for index, size in enumerate(sizes)}
        return Model(loaded, ground, frames, falling, watched, walkers)

    def _load(
        self, robots: Sequence[PlacedRobot], index: int, world: World, settings: Settings
    ) -> LoadedRobot:
        robot, home = robots[index]
        frame, groups = home_frame(robot, home, world), _group(robots, index)
        try:
            return load_robot(self.bullet, robot, frame, settings.wheel_friction, groups)
        except self.bullet.error as error:
            raise SimulationError(
                f"PyBullet cannot load the robot {robot.name} ({single_line(error)}); use "
                f"simulator=mujoco, or simplify the robot's collision shapes and joints"
            ) from error


def _list_sizes(world: World) -> tuple[tuple[float, float], ...]:
    return () if world.crowd is None else world.crowd.sizes


def _group(robots: Sequence[PlacedRobot], index: int) -> Groups:
    if len(robots) == 1:
        return Groups()
    others = sum_others(bodies.ROBOT_BIT, index, len(robots))
    return Groups(bodies.ROBOT_BIT << index, others)
