"""A robot in MuJoCo: links, joints and motors."""

import math
from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

from lxml import etree
from lxml.etree import _Element as Element

from evoros.base.arrays import product
from evoros.base.errors import SimulationError
from evoros.formats.strict_xml import require_child
from evoros.formats.urdf.elements import merge_fixed_links
from evoros.formats.urdf.parts import Joint, read_origin, read_tensor, read_value
from evoros.formats.urdf.tree import Urdf, read_tree
from evoros.geometry.shapes import Shape
from evoros.robot.model import Robot
from evoros.simulator.engines import mujoco_bodies
from evoros.simulator.engines.teams import CHASSIS_FRICTION

MOTOR_INERTIA = 1e6  # [kg m2] of a motor's rotor, so large that loads do not affect its rate
ROOT_JOINT = "evoros root"  # name of the root link's free joint


class Making(NamedTuple):
    """Settings for building a robot."""

    wheel_friction: float
    gain: float  # fraction of the steering error corrected per step
    bond: dict[str, Any]  # contact parameters that couple joints to motors
    prefix: str = ""  # prefix of the names of all elements
    masks: tuple[int, int] = mujoco_bodies.MEETS[mujoco_bodies.ROBOT]  # contype and conaffinity


def add_robot(spec: Any, library: Any, robot: Robot, making: Making) -> list[mujoco_bodies.Sole]:
    """Add a robot with its root link at the origin; return the shapes that can touch the ground."""
    drive = robot.drive
    root = etree.fromstring(merge_fixed_links(robot.urdf_elements(), drive.caster_links).encode())
    urdf = read_tree(root, robot.name)
    driven = {*drive.wheel_joints, *drive.steering_joints}
    bodies = _add_tree(spec, library, urdf, driven, making.prefix)
    for element in root.findall("link"):
        _set_inertia(bodies[str(element.get("name"))], element.find("inertial"))
    for name in drive.wheel_joints:
        effort = urdf.joints[name].effort
        _add_wheel_motor(spec, library, making.prefix + name, effort, making.bond)
    for name in drive.steering_joints:
        _add_servo(spec, library, making.prefix + name, making.gain, making.bond)
    rolling = {urdf.joints[name].child: making.wheel_friction for name in drive.wheel_joints}
    rolling |= dict.fromkeys(drive.caster_links, 0.0)
    soles = []
    for link, shapes in urdf.shapes.items():
        covered = link in rolling and link not in robot.exposed_links
        masks = None if covered else making.masks
        names = _add_link(spec, library, bodies[link], shapes, link in rolling, masks)
        friction = rolling.get(link, CHASSIS_FRICTION)
        soles += [mujoco_bodies.Sole(name, friction, link in rolling) for name in names]
    return soles


def _add_tree(
    spec: Any, library: Any, urdf: Urdf, driven: Collection[str], prefix: str
) -> dict[str, Any]:
    awake = library.mjtSleepPolicy.mjSLEEP_NEVER
    root = spec.worldbody.add_body(name=prefix + urdf.root, sleep=awake)
    root.add_joint(name=prefix + ROOT_JOINT, type=library.mjtJoint.mjJNT_FREE)
    bodies, frontier = {urdf.root: root}, [urdf.root]
    while frontier:
        name = frontier.pop()
        for joint in urdf.children_of(name):
            pose = {"pos": joint.origin.position, "quat": mujoco_bodies.scalar_first(joint.origin)}
            child = bodies[name].add_body(name=prefix + joint.child, **pose)
            if joint.type != "fixed":
                _add_joint(child, library, joint, joint.name in driven, prefix)
            bodies[joint.child] = child
            frontier.append(joint.child)
    return bodies


def _set_inertia(body: Any, inertial: Element | None) -> None:
    body.explicitinertial = True
    if inertial is None:  # a massless frame, rigidly attached to the parent link
        body.mass, body.inertia, body.ipos = 0.0, [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        return
    frame = read_origin(inertial)
    rotation = frame.rotation
    t = product(product(rotation, read_tensor(require_child(inertial, "inertia"))), rotation.T)
    body.mass, body.ipos = read_value(require_child(inertial, "mass"), "value"), frame.position
    body.fullinertia = [t[0, 0], t[1, 1], t[2, 2], t[0, 1], t[0, 2], t[1, 2]]


def _add_joint(body: Any, library: Any, joint: Joint, driven: bool, prefix: str) -> None:
    kinds = {
        "continuous": library.mjtJoint.mjJNT_HINGE,
        "revolute": library.mjtJoint.mjJNT_HINGE,
        "prismatic": library.mjtJoint.mjJNT_SLIDE,
    }
    if joint.type not in kinds:
        raise SimulationError(f"MuJoCo does not support {joint.type} joints such as {joint.name!r}")
    added = body.add_joint(name=prefix + joint.name, type=kinds[joint.type], axis=joint.axis)
    if not driven and math.isfinite(joint.lower) and math.isfinite(joint.upper):
        added.limited, added.range = True, [joint.lower, joint.upper]


def _add_rotor(spec: Any, library: Any, joint: str) -> str:
    name, awake = rotor_of(joint), library.mjtSleepPolicy.mjSLEEP_NEVER
    inertia = [MOTOR_INERTIA] * 3
    rotor = spec.worldbody.add_body(mass=1.0, inertia=inertia, **mujoco_bodies.CENTRED, sleep=awake)
    rotor.add_joint(name=name, type=library.mjtJoint.mjJNT_HINGE, axis=[0.0, 0.0, 1.0])
    return name


def rotor_of(joint: str) -> str:
    """Return the name of the rotor joint that a driven joint follows."""
    return f"{joint} rotor"


def _add_wheel_motor(
    spec: Any, library: Any, joint: str, effort: float, bond: dict[str, Any]
) -> None:
    """Couple a joint to its rotor, with a torque of at most ``effort`` [N m]."""
    # Friction transmits the torque, because an actuator would oscillate at its torque limit.
    friction = {"solref_friction": bond["solref"], "solimp_friction": bond["solimp"]}
    tendon = spec.add_tendon(name=joint, frictionloss=effort, **friction)
    tendon.wrap_joint(joint, 1.0)
    tendon.wrap_joint(_add_rotor(spec, library, joint), -1.0)


def _add_servo(spec: Any, library: Any, joint: str, gain: float, bond: dict[str, Any]) -> None:
    """Couple a joint to its rotor, which turns by ``gain * (target - angle)`` per step."""
    rotor = _add_rotor(spec, library, joint)
    spec.add_equality(
        name=joint,
        type=library.mjtEq.mjEQ_JOINT,
        objtype=library.mjtObj.mjOBJ_JOINT,
        name1=joint,
        name2=rotor,
        data=[0.0, 1.0] + [0.0] * 10,
        **bond,
    )
    step = spec.option.timestep
    stiffness = MOTOR_INERTIA * gain / (step * step)
    actuator = spec.add_actuator(name=joint, target=rotor, trntype=library.mjtTrn.mjTRN_JOINT)
    # The explicit damping cancels the previous rate, so that only the error moves the rotor.
    actuator.set_to_position(kp=stiffness, kv=MOTOR_INERTIA / step)


def _add_link(
    spec: Any,
    library: Any,
    body: Any,
    shapes: Sequence[Shape],
    rolls: bool,
    masks: tuple[int, int] | None,
) -> list[str]:
    """Add a link's shapes, twice if an exposed wheel's; return those that may touch the ground."""
    posed = [(shape.pose, shape) for shape in shapes]
    if not posed:
        return []
    names: list[str] = []
    if masks is not None:
        names = mujoco_bodies.add_shapes(spec, library, body, body.name, mujoco_bodies.ROBOT, posed)
        for name in names:
            spec.geom(name).contype, spec.geom(name).conaffinity = masks
            spec.add_sensor(  # detects contacts of a shape
                name=name,
                type=library.mjtSensor.mjSENS_CONTACT,
                objtype=library.mjtObj.mjOBJ_GEOM,
                objname=name,
                intprm=[1, 0, 1],  # report only whether there is a contact
            )
    if rolls:
        name, group = f"{body.name} rolling", mujoco_bodies.ROBOT
        names = mujoco_bodies.add_shapes(spec, library, body, name, group, posed)
        for name in names:
            spec.geom(name).contype = 0
    return names
