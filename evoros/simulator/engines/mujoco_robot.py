"""A robot in MuJoCo: its links, its joints, and the motors that turn them."""

import math
from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

from lxml import etree
from lxml.etree import _Element as Element

from evoros.base.errors import SimulationError
from evoros.base.linear import product
from evoros.formats.strict_xml import require_child
from evoros.formats.urdf.merging import merge_fixed_links
from evoros.formats.urdf.parts import Joint, read_origin, read_tensor, read_value
from evoros.formats.urdf.tree import Urdf, read_tree
from evoros.geometry.shapes import Shape
from evoros.robot.model import Robot
from evoros.simulator.engines.mujoco_bodies import (
    CENTRED,
    MEETS,
    ROBOT,
    Sole,
    add_shapes,
    scalar_first,
)

CHASSIS_FRICTION = 1.0  # the chassis touches the ground only when the robot tips over

MOTOR_INERTIA = 1e6
"""The rotor's that a motor drives [kg m2]: so much that no load changes its rate."""


ROOT_JOINT = "evoros root"
"""The joint by which the robot moves freely."""


class Making(NamedTuple):
    """How a robot is made, besides its description."""

    wheel_friction: float
    gain: float  # share of its error that the steering makes up in one step
    bond: dict[str, Any]  # stiffness with which motors hold their joints
    prefix: str = ""  # of its names
    masks: tuple[int, int] = MEETS[ROBOT]  # type and types met, of links that obstacles can touch


def add_robot(spec: Any, library: Any, robot: Robot, making: Making) -> list[Sole]:
    """Add the robot, its root link at the origin; return its shapes that can touch the ground.

    Raises:
        SimulationError: a joint is of a kind that the engine does not have.
    """
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
        soles += [Sole(name, friction, link in rolling) for name in names]
    return soles


def _add_tree(
    spec: Any, library: Any, urdf: Urdf, driven: Collection[str], prefix: str
) -> dict[str, Any]:
    """Add the links with their joints; return the engine's bodies by the links' names."""
    root = spec.worldbody.add_body(
        name=prefix + urdf.root, sleep=library.mjtSleepPolicy.mjSLEEP_NEVER
    )
    root.add_joint(name=prefix + ROOT_JOINT, type=library.mjtJoint.mjJNT_FREE)
    bodies, frontier = {urdf.root: root}, [urdf.root]
    while frontier:
        name = frontier.pop()
        for joint in urdf.children_of(name):
            child = bodies[name].add_body(
                name=prefix + joint.child,
                pos=joint.origin.position,
                quat=scalar_first(joint.origin),
            )
            if joint.type != "fixed":
                _add_joint(child, library, joint, joint.name in driven, prefix)
            bodies[joint.child] = child
            frontier.append(joint.child)
    return bodies


def _set_inertia(body: Any, inertial: Element | None) -> None:
    body.explicitinertial = True
    if inertial is None:  # a frame, which moves with the link that carries it
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
        raise SimulationError(f"MuJoCo has no {joint.type} joints, as {joint.name!r} is one")
    added = body.add_joint(name=prefix + joint.name, type=kinds[joint.type], axis=joint.axis)
    if not driven and math.isfinite(joint.lower) and math.isfinite(joint.upper):
        added.limited, added.range = True, [joint.lower, joint.upper]


def _add_rotor(spec: Any, library: Any, joint: str) -> str:
    """Add the rotor of a joint's motor, a body that nothing touches; return its own joint."""
    name = rotor_of(joint)
    moments = [MOTOR_INERTIA] * 3
    rotor = spec.worldbody.add_body(
        mass=1.0, inertia=moments, **CENTRED, sleep=library.mjtSleepPolicy.mjSLEEP_NEVER
    )
    rotor.add_joint(name=name, type=library.mjtJoint.mjJNT_HINGE, axis=[0.0, 0.0, 1.0])
    return name


def rotor_of(joint: str) -> str:
    """The joint of the rotor whose rate a driven joint takes."""
    return f"{joint} rotor"


def _add_wheel_motor(
    spec: Any, library: Any, joint: str, effort: float, bond: dict[str, Any]
) -> None:
    """Let a joint turn as its rotor, by a torque of at most ``effort`` [N m].

    Friction between both does that, which the engine solves together with the contacts. An
    actuator of the engine would need a gain, and oscillate where its torque is limited.
    """
    tendon = spec.add_tendon(
        name=joint,
        frictionloss=effort,
        solref_friction=bond["solref"],
        solimp_friction=bond["solimp"],
    )
    tendon.wrap_joint(joint, 1.0)
    tendon.wrap_joint(_add_rotor(spec, library, joint), -1.0)


def _add_servo(spec: Any, library: Any, joint: str, gain: float, bond: dict[str, Any]) -> None:
    """Let a joint follow the angle of its rotor, which an actuator turns to the wanted angle.

    The actuator moves nothing but the rotor, which moves as the lag does:
    ``angle += gain * (wanted - angle)`` in each step.
    """
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
    # Explicit in the rate, which it sets to 0 in each step but for what the error asks for.
    actuator.set_to_position(kp=stiffness, kv=MOTOR_INERTIA / step)


def _add_link(
    spec: Any,
    library: Any,
    body: Any,
    shapes: Sequence[Shape],
    rolls: bool,
    masks: tuple[int, int] | None,
) -> list[str]:
    """Add the collision shapes of a link; return the names of those that touch the ground.

    ``masks`` are None for a link that obstacles cannot touch.
    A wheel or caster that sticks out has each shape twice, on the ground and against obstacles, so
    that a sensor of the engine can tell these contacts apart at no cost.
    """
    posed = [(shape.pose, shape) for shape in shapes]
    if not posed:
        return []
    names: list[str] = []
    if masks is not None:
        names = add_shapes(spec, library, body, body.name, ROBOT, posed)
        for name in names:
            spec.geom(name).contype, spec.geom(name).conaffinity = masks
            _add_touch(spec, library, name)
    if rolls:
        names = add_shapes(spec, library, body, f"{body.name} rolling", ROBOT, posed)
        for name in names:
            spec.geom(name).contype = 0
    return names


def _add_touch(spec: Any, library: Any, shape: str) -> None:
    """Let a sensor of the engine count the contacts of a shape."""
    spec.add_sensor(
        name=shape,
        type=library.mjtSensor.mjSENS_CONTACT,
        objtype=library.mjtObj.mjOBJ_GEOM,
        objname=shape,
        intprm=[1, 0, 1],  # whether one was found, in any order, one
    )
