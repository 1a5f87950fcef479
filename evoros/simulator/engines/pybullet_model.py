"""A robot and a world as PyBullet bodies: building them, and putting them back."""

import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from evoros.base.errors import SimulationError
from evoros.formats.urdf.merging import merge_fixed_links
from evoros.geometry.shapes import Body, Shape
from evoros.robot.model import Robot
from evoros.world.model import World

# Collision groups. Rays come in group 1 (the engine's default), and so nothing else is in it.
# Wheels and casters meet the ground only, the robot never itself, and what is fixed not what is
# fixed: such pairs cost the engine time wherever walls touch each other or the ground.
RAY, ROBOT, GROUND, FIXED, MOVABLE = 1, 2, 4, 8, 16
SEEN = GROUND | FIXED | MOVABLE
MOVING = RAY | ROBOT | MOVABLE

BODY_FRICTION = 1.0  # of the chassis, which touches the ground only when the robot tips over

UPWARDS = 1000.0  # [m]: far from everything

Frame = tuple[tuple[float, ...], tuple[float, ...]]  # position [m], quaternion (x, y, z, w)


class Settings(NamedTuple):
    """What the engine is told besides robot and world."""

    time_step: float
    solver_iterations: int
    wheel_friction: float
    steering_lag_s: float


@dataclass(frozen=True)
class Model:
    """The loaded bodies, and where each belongs at the start of a mission."""

    body: int  # of the robot
    ground: frozenset[int]  # bodies that are no obstacle
    touching: tuple[int, ...]  # links that can touch obstacles
    movable: Mapping[int, Frame]  # the bodies that can be pushed, and where they stand
    steering: tuple[int, ...]  # joints
    wheels: tuple[int, ...]
    steering_forces: tuple[float, ...]  # [N m]
    wheel_forces: tuple[float, ...]
    joints: tuple[int, ...]  # that are not fixed
    start: Frame  # of the robot's centre of mass
    to_base: Frame  # from the centre of mass to the base link


class Engine:
    """One PyBullet client and the model that it holds."""

    def __init__(self, bullet: Any) -> None:
        self.bullet = bullet
        self.client: int = bullet.connect(bullet.DIRECT)
        self._loaded: tuple[Any, ...] | None = None
        self._model: Model | None = None

    def close(self) -> None:
        """Disconnect; the engine cannot be used any more."""
        self.bullet.disconnect(self.client)

    def forget(self) -> None:
        """The next mission builds its model."""
        self._loaded = None

    def prepare(self, robot: Robot, world: World, settings: Settings) -> Model:
        """The model at the start of a mission: reset where it can be, else built."""
        drive = robot.drive
        parts = (drive.steering_joints, drive.wheel_joints, drive.caster_links)
        wanted = (robot.urdf, parts, world.bodies, world.course.home, settings)
        if self._model is None or self._loaded != wanted or self._disturbed(self._model):
            self._loaded = None
            try:
                self._model = self._build(robot, world, settings)
            except self.bullet.error as error:
                reason = f"PyBullet refuses {robot.name} in {world.name}: {error}"
                raise SimulationError(reason) from error
            self._loaded = wanted
        self._reset(self._model)
        return self._model

    def _disturbed(self, model: Model) -> bool:
        """Whether anything but the robot is not as it was built.

        The engine wakes a body when the robot is near, and a body that is awake settles: it need
        not be touched to be moved.
        """
        bullet, client = self.bullet, self.client
        rest = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        return any(
            bullet.getBasePositionAndOrientation(body, client) != place
            or bullet.getBaseVelocity(body, client) != rest
            for body, place in model.movable.items()
        )

    def _reset(self, model: Model) -> None:
        """The robot at its start, at rest: also after building, so that both give the same bits.

        A step far above the ground first: the engine keeps contacts, with their forces, for as
        long as their bodies are near each other.
        """
        bullet, client = self.bullet, self.client
        (x, y, z), facing = model.start
        for height in (z + UPWARDS, z):
            place = (x, y, height)
            bullet.resetBasePositionAndOrientation(model.body, place, facing, client)
            bullet.resetBaseVelocity(model.body, (0, 0, 0), (0, 0, 0), client)
            for joint in model.joints:
                bullet.resetJointState(model.body, joint, 0, 0, client)
            if height > z:
                bullet.stepSimulation(client)

    def _build(self, robot: Robot, world: World, settings: Settings) -> Model:
        bullet, client = self.bullet, self.client
        bullet.resetSimulation(physicsClientId=client)
        bullet.setGravity(0, 0, -9.81, physicsClientId=client)
        bullet.setPhysicsEngineParameter(
            fixedTimeStep=settings.time_step,
            numSolverIterations=settings.solver_iterations,
            enableFileCaching=0,  # else a rewritten URDF loads its old geometry
            deterministicOverlappingPairs=1,
            collisionFilterMode=0,  # else a pair collides where one of the two masks says so
            physicsClientId=client,
        )
        numbers = [(self._add(body), body) for body in world.bodies]
        movable = {
            number: bullet.getBasePositionAndOrientation(number, physicsClientId=client)
            for number, body in numbers
            if body.mass is not None
        }
        ground = frozenset(number for number, body in numbers if body.is_ground)
        return self._load(robot, world, settings, ground, movable)

    def _add(self, body: Body) -> int:
        """One body of the world; movable ones start asleep and wake when the robot comes near.

        In maximal coordinates: the engine's usual ones, made for chains of links, cost more.
        """
        bullet, client = self.bullet, self.client
        number: int = bullet.createMultiBody(
            body.mass or 0.0,
            create_shape(bullet, client, body.shapes),
            -1,
            body.pose.position,
            body.pose.quaternion,
            useMaximalCoordinates=True,
            physicsClientId=client,
        )
        group, meets = (GROUND if body.is_ground else FIXED), MOVING
        if body.mass is not None:
            group, meets = MOVABLE, MOVING | GROUND | FIXED
        bullet.setCollisionFilterGroupMask(number, -1, group, meets, physicsClientId=client)
        bullet.changeDynamics(number, -1, lateralFriction=body.friction, physicsClientId=client)
        if body.mass is not None and body.inertia is not None:
            bullet.changeDynamics(  # without its mass it would lose it
                number,
                -1,
                mass=body.mass,
                localInertiaDiagonal=body.inertia,
                physicsClientId=client,
            )
        if body.mass is not None:
            asleep = bullet.ACTIVATION_STATE_ENABLE_SLEEPING | bullet.ACTIVATION_STATE_SLEEP
            bullet.changeDynamics(number, -1, activationState=asleep, physicsClientId=client)
        return number

    def _load(
        self,
        robot: Robot,
        world: World,
        settings: Settings,
        ground: frozenset[int],
        movable: Mapping[int, Frame],
    ) -> Model:
        bullet, client, course, drive = self.bullet, self.client, world.course, robot.drive
        position, yaw = course.home[:3], course.home[3]
        facing = (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
        # Not URDF_MERGE_FIXED_LINKS: it would lose the origin of the chassis' inertia.
        flags = bullet.URDF_USE_INERTIA_FROM_FILE | bullet.URDF_IGNORE_VISUAL_SHAPES
        urdf = merge_fixed_links(robot.urdf, drive.caster_links)
        body = load_urdf(bullet, client, urdf, (position, facing), flags)
        infos = [
            bullet.getJointInfo(body, joint, physicsClientId=client)
            for joint in range(bullet.getNumJoints(body, physicsClientId=client))
        ]
        number = {info[1].decode(): info[0] for info in infos}
        wheels = tuple(number[name] for name in drive.wheel_joints)
        steering = tuple(number[name] for name in drive.steering_joints)
        friction = {info[0]: 0.0 for info in infos if info[12].decode() in drive.caster_links}
        friction.update(dict.fromkeys(wheels, settings.wheel_friction))  # of what meets the ground
        for link in range(-1, len(infos)):
            meets = GROUND if link in friction else GROUND | FIXED | MOVABLE
            bullet.setCollisionFilterGroupMask(body, link, ROBOT, meets, physicsClientId=client)
            bullet.changeDynamics(
                body,
                link,
                lateralFriction=friction.get(link, BODY_FRICTION),
                linearDamping=0,
                angularDamping=0,
                jointDamping=0,
                physicsClientId=client,
            )
        local = bullet.getDynamicsInfo(body, -1, physicsClientId=client)[3:5]
        return Model(
            body=body,
            ground=ground,
            touching=tuple(
                link
                for link in range(-1, len(infos))
                if link not in friction and bullet.getCollisionShapeData(body, link, client)
            ),
            movable=movable,
            steering=steering,
            wheels=wheels,
            steering_forces=tuple(infos[joint][10] for joint in steering),
            wheel_forces=tuple(infos[joint][10] for joint in wheels),
            joints=tuple(info[0] for info in infos if info[2] != bullet.JOINT_FIXED),
            start=bullet.multiplyTransforms(position, facing, *local),
            to_base=bullet.invertTransform(*local),
        )


def create_shape(bullet: Any, client: int, shapes: Sequence[Shape]) -> int:
    """The number of one collision shape, compound where a body has several."""
    arguments = [_shape(bullet, shape) for shape in shapes]
    if len(arguments) == 1 and shapes[0].kind == "plane":
        return int(
            bullet.createCollisionShape(
                bullet.GEOM_PLANE, planeNormal=shapes[0].size, physicsClientId=client
            )
        )
    columns = {key: [shape[key] for shape in arguments] for key in arguments[0]}
    return int(bullet.createCollisionShapeArray(**columns, physicsClientId=client))


def _shape(bullet: Any, shape: Shape) -> dict[str, Any]:
    size = shape.size
    kinds = {
        "box": bullet.GEOM_BOX,
        "cylinder": bullet.GEOM_CYLINDER,
        "sphere": bullet.GEOM_SPHERE,
        "plane": bullet.GEOM_PLANE,
    }
    return {
        "shapeTypes": kinds[shape.kind],
        "halfExtents": [edge / 2 for edge in size] if shape.kind == "box" else [0, 0, 0],
        "radii": size[0] if shape.kind in ("sphere", "cylinder") else 0.0,
        "lengths": size[1] if shape.kind == "cylinder" else 0.0,
        "planeNormals": size if shape.kind == "plane" else [0, 0, 1],
        "collisionFramePositions": shape.pose.position,
        "collisionFrameOrientations": shape.pose.quaternion,
    }


def load_urdf(bullet: Any, client: int, urdf: str, place: Frame, flags: int) -> int:
    """The number of the robot; PyBullet reads URDF from a file only."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(urdf)
        return int(bullet.loadURDF(str(path), *place, flags=flags, physicsClientId=client))
