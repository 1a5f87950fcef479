"""A PyBullet client with the model of a robot in a world, which it builds or resets."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from evoros.base.errors import SimulationError
from evoros.robot.model import Robot
from evoros.simulator.engines.pybullet_bodies import add_body, find_falling, measure_radius, wake
from evoros.simulator.engines.pybullet_robot import LoadedRobot, load_robot
from evoros.simulator.engines.pybullet_shapes import Frame
from evoros.simulator.engines.set_down import home_frame
from evoros.world.model import World

LIFT_M = 1000.0  # height at which a robot is far from everything
AT_REST = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))  # velocity and angular velocity of a body


class Settings(NamedTuple):
    """What the engine needs to know besides robot and world."""

    time_step: float  # [s]
    solver_iterations: int
    wheel_friction: float
    steering_lag_s: float


@dataclass(frozen=True)
class Model:
    """The loaded bodies."""

    robot: LoadedRobot
    ground: frozenset[int]  # bodies that are not obstacles
    movable: Mapping[int, Frame]  # bodies that can be pushed, and where they stood when built
    falling: tuple[int, ...]  # movable bodies in the air
    watched: Mapping[int, float]  # movable bodies that need finer steps, and their radii [m]


class Engine:
    """One PyBullet client and the model that it holds."""

    def __init__(self, bullet: Any) -> None:
        self.bullet = bullet
        self.client: int = bullet.connect(bullet.DIRECT)
        self._built_from: tuple[Any, ...] | None = None
        self._model: Model | None = None

    def close(self) -> None:
        """Disconnect; the engine cannot be used any more."""
        self.bullet.disconnect(self.client)

    def forget(self) -> None:
        """Make the next mission build its model."""
        self._built_from = None

    def prepare(self, robot: Robot, world: World, settings: Settings) -> Model:
        """The model at the start of a mission, reset if possible and else built.

        Raises:
            SimulationError: PyBullet refuses the robot or the world.
        """
        drive = robot.drive
        joints = (drive.steering_joints, drive.wheel_joints, drive.caster_links)
        course = world.course
        surroundings = (world.bodies, world.gravity_mps2, course.home, course.end_on_collision)
        described = (robot.urdf, robot.engine_text, joints, robot.exposed_links)
        source = (described, surroundings, settings)
        if self._model is None or self._built_from != source or self._disturbed(self._model):
            self._built_from = None
            try:
                self._model = self._build(robot, world, settings)
            except self.bullet.error as error:
                reason = f"PyBullet refuses {robot.name} in {world.name}: {error}"
                raise SimulationError(reason) from error
            self._built_from = source
        self.bullet.setTimeStep(settings.time_step, self.client)  # a mission may have made it finer
        self._reset(self._model.robot)
        for number in self._model.falling:
            wake(self.bullet, self.client, number)
        return self._model

    def _disturbed(self, model: Model) -> bool:
        """Whether any body but the robot differs from when it was built, or is about to fall.

        The engine wakes a body when the robot is near, and a body that is awake settles. So a
        body can move without being touched.
        """
        bullet, client = self.bullet, self.client
        return bool(model.falling) or any(
            bullet.getBasePositionAndOrientation(body, client) != frame
            or bullet.getBaseVelocity(body, client) != AT_REST
            for body, frame in model.movable.items()
        )

    def _reset(self, robot: LoadedRobot) -> None:
        """Put the robot at its start, at rest. Also done after building, to get the same bits.

        The engine keeps contacts, with their forces, as long as their bodies are near each other.
        So the robot first makes one step far above the ground.
        """
        bullet, client = self.bullet, self.client
        (x, y, z), facing = robot.start
        for height in (z + LIFT_M, z):
            position = (x, y, height)
            bullet.resetBasePositionAndOrientation(robot.body, position, facing, client)
            bullet.resetBaseVelocity(robot.body, (0, 0, 0), (0, 0, 0), client)
            for joint in robot.joints:
                bullet.resetJointState(robot.body, joint, 0, 0, client)
            if height > z:
                bullet.stepSimulation(client)

    def _build(self, robot: Robot, world: World, settings: Settings) -> Model:
        bullet, client = self.bullet, self.client
        bullet.resetSimulation(physicsClientId=client)
        bullet.setGravity(0, 0, -world.gravity_mps2, physicsClientId=client)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=settings.time_step,
            numSolverIterations=settings.solver_iterations,
            enableFileCaching=0,  # else a rewritten URDF loads its old geometry
            deterministicOverlappingPairs=1,
            collisionFilterMode=0,  # else a pair collides if only one of the two masks says so
            physicsClientId=client,
        )
        if not robot.drive.steering_joints and len(robot.drive.wheel_joints) > 2:
            # Skid-steer: the engine's usual friction of a sliding wheel is not against its slip.
            bullet.setPhysicsEngineParameter(enableConeFriction=0, physicsClientId=client)
        numbers = [
            (number, body) for body in world.bodies for number in add_body(bullet, client, body)
        ]
        movable = {number: body for number, body in numbers if body.mass is not None}
        frames = {
            number: bullet.getBasePositionAndOrientation(number, physicsClientId=client)
            for number in movable
        }
        ground = frozenset(number for number, body in numbers if body.is_ground)
        falling = find_falling(bullet, client, world, movable)
        # A mission that ends at the first contact pushes nothing.
        pushing = falling or not world.course.end_on_collision
        watched = {n: measure_radius(bullet, client, n) for n in movable if pushing}
        home, friction = home_frame(robot, world), settings.wheel_friction
        loaded = load_robot(bullet, client, robot, home, friction)
        return Model(loaded, ground, frames, falling, watched)
