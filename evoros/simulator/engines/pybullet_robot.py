"""A robot in PyBullet: its colliding links and its driven joints."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from lxml.etree import _Element as Element

from evoros.drive.protocol import Drive, skids
from evoros.formats.urdf.elements import merge_fixed_links
from evoros.robot.model import Robot
from evoros.simulator.engines import pybullet_bodies as bodies
from evoros.simulator.engines.teams import CHASSIS_FRICTION, Frame

UNDAMPED = {"linearDamping": 0, "angularDamping": 0, "jointDamping": 0}


@dataclass(frozen=True)
class LoadedRobot:
    """A robot as an engine body, with the engine's indices of links and joints."""

    body: int
    touching: tuple[int, ...]  # links that can touch obstacles
    joints: tuple[int, ...]  # all joints except fixed joints
    steering: tuple[int, ...]  # steering joints
    steering_forces: tuple[float, ...]  # [N m]
    wheels: tuple[int, ...]  # wheel joints
    wheel_forces: tuple[float, ...]  # [N m]
    start: Frame  # frame of the centre of mass at the start of a mission
    to_base: Frame  # frame of the base link relative to the centre of mass
    seen: int  # collision groups that the robot's sensors detect


class Groups(NamedTuple):
    """The collision groups of a robot among several; all 0 for a single robot."""

    bit: int = 0  # the robot's group
    others: int = 0  # groups of the other robots


class _Joint(NamedTuple):
    """A joint and its child link, which have the same index in the engine."""

    joint_id: int
    name: str
    link: str
    fixed: bool
    force: float  # [N m], maximum motor torque


def load_robot(
    bullet: Any,
    robot: Robot,
    frame: Frame,
    wheel_friction: float,
    groups: Groups = Groups(),  # noqa: B008 - immutable
) -> LoadedRobot:
    """Load the robot with its base link at ``frame``."""
    drive = robot.drive
    # URDF_MERGE_FIXED_LINKS would lose the origin of the chassis inertia.
    flags = bullet.URDF_USE_INERTIA_FROM_FILE | bullet.URDF_IGNORE_VISUAL_SHAPES
    elements = robot.urdf_elements()
    if _rolls_on_cylinders(elements, drive):
        flags |= bullet.URDF_USE_IMPLICIT_CYLINDER
    urdf = merge_fixed_links(elements, drive.caster_links)
    body = bodies.load_urdf(bullet, urdf, frame, flags)
    joints = _read_joints(bullet, body)
    steering, steering_forces = _motors(joints, drive.steering_joints)
    wheels, wheel_forces = _motors(joints, drive.wheel_joints)
    for joint in joints:  # otherwise, default motors of the engine brake undriven joints
        if not joint.fixed and joint.joint_id not in (*steering, *wheels):
            bullet.setJointMotorControl2(body, joint.joint_id, bullet.VELOCITY_CONTROL, force=0)
    center = bullet.getDynamicsInfo(body, -1)[3:5]
    return LoadedRobot(
        body=body,
        touching=_set_up_links(bullet, body, joints, robot, wheel_friction, groups),
        joints=tuple(joint.joint_id for joint in joints if not joint.fixed),
        steering=steering,
        steering_forces=steering_forces,
        wheels=wheels,
        wheel_forces=wheel_forces,
        start=bullet.multiplyTransforms(*frame, *center),
        to_base=bullet.invertTransform(*center),
        seen=bodies.VISIBLE | groups.others,
    )


def _rolls_on_cylinders(elements: Element, drive: Drive) -> bool:
    """Return True for cylinders without slip; the engine's prisms drive up to 4 % too fast."""
    if skids(drive):
        return False
    wheels = {
        child.get("link")
        for joint in elements.findall("joint")
        if joint.get("name") in drive.wheel_joints
        for child in joint.findall("child")
    }
    return any(
        link.find("collision/geometry/cylinder") is not None
        for link in elements.findall("link")
        if link.get("name") in wheels
    )


def _read_joints(bullet: Any, body: int) -> list[_Joint]:
    joints = []
    for index in range(bullet.getNumJoints(body)):
        info = bullet.getJointInfo(body, index)
        name, link, fixed = info[1].decode(), info[12].decode(), info[2] == bullet.JOINT_FIXED
        joints.append(_Joint(index, name, link, fixed, info[10]))
    return joints


def _motors(
    joints: Sequence[_Joint], names: Sequence[str]
) -> tuple[tuple[int, ...], tuple[float, ...]]:
    by_name = {joint.name: joint for joint in joints}
    chosen = [by_name[name] for name in names]
    return tuple(joint.joint_id for joint in chosen), tuple(joint.force for joint in chosen)


def _rolling_friction(
    joints: Sequence[_Joint], drive: Drive, wheel_friction: float
) -> dict[int, float]:
    friction = {joint.joint_id: 0.0 for joint in joints if joint.link in drive.caster_links}
    wheels = (joint.joint_id for joint in joints if joint.name in drive.wheel_joints)
    return friction | dict.fromkeys(wheels, wheel_friction)


def _set_up_links(
    bullet: Any,
    body: int,
    joints: Sequence[_Joint],
    robot: Robot,
    wheel_friction: float,
    groups: Groups,
) -> tuple[int, ...]:
    rolling = _rolling_friction(joints, robot.drive, wheel_friction)
    exposed = {joint.joint_id for joint in joints if joint.link in robot.exposed_links}
    covered = rolling.keys() - exposed
    links = range(-1, len(joints))
    for link in links:
        group, meets = bodies.ROBOT, bodies.GROUND
        if link not in covered:
            group, meets = bodies.ROBOT | groups.bit, bodies.VISIBLE | groups.others
            meets |= bodies.RAY if groups.bit else 0
        bullet.setCollisionFilterGroupMask(body, link, group, meets)
        friction = rolling.get(link, CHASSIS_FRICTION)
        bullet.changeDynamics(body, link, lateralFriction=friction, **UNDAMPED)
    shapes = (link for link in links if bullet.getCollisionShapeData(body, link))
    return tuple(link for link in shapes if link not in covered)
