"""A robot as SDF, for the server of Gazebo's physics."""

from collections.abc import Collection, Mapping

from lxml import etree
from lxml.etree import _Element as Element

from evoros.base.errors import SimulationError
from evoros.drive.wheels import skids
from evoros.formats.strict_xml import require_child
from evoros.formats.urdf.merging import merge_fixed_links
from evoros.formats.urdf.parts import Joint, read_origin, read_tensor, read_value
from evoros.formats.urdf.tree import Urdf, read_tree
from evoros.geometry.shapes import Pose, Shape
from evoros.robot.model import Robot
from evoros.simulator.engines.gazebo_shapes import (
    OBSTACLE,
    ROLLING,
    SOLID,
    Inertial,
    Solid,
    format_link,
    format_numbers,
    format_pose,
)

CHASSIS_FRICTION = 1.0  # the chassis touches the ground only when the robot tips over
LIGHT = Inertial(1e-6, Pose(), (1e-9, 1e-9, 1e-9, 0.0, 0.0, 0.0))
"""A frame, which moves with the link that carries it; DART needs masses above 0."""

_TYPES = {
    "fixed": "fixed",
    "continuous": "revolute",
    "revolute": "revolute",
    "prismatic": "prismatic",
}


def format_robot(
    robot: Robot, index: int, frame: Pose, wheel_friction: float
) -> tuple[str, list[str]]:
    """Return the model of a robot at ``frame``, the pose of its root link, and its meshes.

    Raises:
        SimulationError: a joint is of a kind that SDF does not have.
    """
    drive, model = robot.drive, f"robot{index}"
    root = etree.fromstring(merge_fixed_links(robot.urdf_elements(), drive.caster_links).encode())
    urdf = read_tree(root, robot.name)
    links = _name_links(urdf)
    joints = {name: f"wheel{i}" for i, name in enumerate(drive.wheel_joints)}
    joints |= {name: f"steering{i}" for i, name in enumerate(drive.steering_joints)}
    wheels = {urdf.joints[name].child for name in drive.wheel_joints}
    texts, meshes = [], []
    for element in root.findall("link"):
        name = str(element.get("name"))
        solids = _find_solids(robot, name, urdf.shapes[name], name in wheels, wheel_friction)
        inertial = _read_inertial(element.find("inertial"))
        text, more = format_link(model, links[name], urdf.poses[name], inertial, solids)
        texts.append(text)
        meshes += more
    for i, joint in enumerate(urdf.joints.values()):
        texts.append(_format_joint(joint, joints.get(joint.name, f"free{i}"), links, joints))
    return f'<model name="{model}">{format_pose(frame)}{"".join(texts)}</model>', meshes


def _name_links(urdf: Urdf) -> dict[str, str]:
    """Return the links' names for the server: the root is ``link0``."""
    others = (name for name in urdf.shapes if name != urdf.root)
    return {name: f"link{i}" for i, name in enumerate([urdf.root, *others])}


def _find_solids(
    robot: Robot, link: str, shapes: Collection[Shape], is_wheel: bool, wheel_friction: float
) -> list[Solid]:
    """Return the collision shapes of a link.

    Wheels and casters that stick out have each shape twice, on the ground and against obstacles.
    """
    casters = robot.drive.caster_links
    if not is_wheel and link not in casters:
        return [Solid(SOLID, shape, shape.pose, CHASSIS_FRICTION) for shape in shapes]
    friction = wheel_friction if is_wheel else 0.0
    rounded = is_wheel and not skids(robot.drive)
    solids = [
        Solid(ROLLING, _round(shape) if rounded else shape, shape.pose, friction)
        for shape in shapes
    ]
    if link in robot.exposed_links:
        solids += [Solid(OBSTACLE, shape, shape.pose, CHASSIS_FRICTION) for shape in shapes]
    return solids


def _round(shape: Shape) -> Shape:
    """Return a wheel as a sphere: a cylinder touches the ground at one of its edges.

    It then drives on another radius than its own, up to 11 % off in turns.
    """
    return Shape("sphere", shape.size[:1], shape.pose) if shape.kind == "cylinder" else shape


def _read_inertial(inertial: Element | None) -> Inertial:
    if inertial is None:
        return LIGHT
    t = read_tensor(require_child(inertial, "inertia")).tolist()
    moments = (t[0][0], t[1][1], t[2][2], t[0][1], t[0][2], t[1][2])
    mass = read_value(require_child(inertial, "mass"), "value")
    return Inertial(mass, read_origin(inertial), moments)


def _format_joint(
    joint: Joint, name: str, links: Mapping[str, str], driven: Collection[str]
) -> str:
    if joint.type not in _TYPES:
        raise SimulationError(f"Gazebo has no {joint.type} joints, as {joint.name!r} is one")
    limits = f"<effort>{format_numbers([joint.effort])}</effort>" if joint.name in driven else ""
    if joint.name not in driven and joint.type in ("revolute", "prismatic"):
        lower, upper = format_numbers([joint.lower, joint.upper]).split()
        limits = f"<lower>{lower}</lower><upper>{upper}</upper>"
    axis = format_numbers(joint.axis.tolist())
    turning = f"<axis><xyz>{axis}</xyz><limit>{limits}</limit></axis>"
    return (
        f'<joint name="{name}" type="{_TYPES[joint.type]}"><parent>{links[joint.parent]}</parent>'
        f"<child>{links[joint.child]}</child>{turning if joint.type != 'fixed' else ''}</joint>"
    )
