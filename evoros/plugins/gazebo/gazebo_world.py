"""Writes robots and worlds as SDF for the Gazebo physics server."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from lxml import etree
from lxml.etree import _Element as Element
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.errors import SimulationError
from evoros.drive.protocol import lag_gain, skids
from evoros.formats.sdf.writer import GEOMETRY
from evoros.formats.strict_xml import require_child
from evoros.formats.urdf.elements import merge_fixed_links
from evoros.formats.urdf.parts import Joint, read_origin, read_tensor, read_value
from evoros.formats.urdf.tree import read_tree
from evoros.geometry.footprint import height_points, lowest_point
from evoros.geometry.polyhedron import convex_polyhedron, joint_moments
from evoros.geometry.shapes import Body, Pose, Shape
from evoros.robot.model import Robot
from evoros.simulator.engines.mujoco_bodies import scalar_first
from evoros.simulator.engines.mujoco_model import Settings
from evoros.simulator.engines.teams import CHASSIS_FRICTION, MAX_FRICTION, home_frame
from evoros.simulator.engines.walking import GAP_M as WALKER_GAP_M
from evoros.simulator.protocol import PlacedRobot
from evoros.world.floors import ground_height
from evoros.world.model import KEPT_WORLDS, World
from evoros.world.standing import GAP_M

GROUND, OBSTACLE, SOLID, ROLLING, WALKER = "ground", "obstacle", "solid", "rolling", "walker"
"""Groups: solid shapes meet obstacles, walkers and the ground, rolling ones only the ground."""

_COLLISION = (
    '<collision name="{name}">{pose}<geometry>{geometry}</geometry><surface><friction><ode>'
    "<mu>{mu}</mu><mu2>{mu}</mu2></ode></friction></surface></collision>"
)
_INERTIAL = (
    "<inertial>{pose}<mass>{mass}</mass><inertia><ixx>{}</ixx><iyy>{}</iyy><izz>{}</izz>"
    "<ixy>{}</ixy><ixz>{}</ixz><iyz>{}</iyz></inertia></inertial>"
)


class Solid(NamedTuple):
    """A collision shape of a link."""

    group: str
    shape: Shape
    pose: Pose  # relative to the link's frame
    friction: float


class Inertial(NamedTuple):
    """The inertia of a link."""

    mass: float  # [kg]
    pose: Pose  # centre of mass
    moments: Sequence[float]  # xx, yy, zz, xy, xz, yz [kg m2]


def format_link(
    model: str, link: str, pose: Pose, inertial: Inertial | None, solids: Sequence[Solid]
) -> tuple[str, list[str]]:
    """Return a link as SDF, and requests that make the server attach its meshes."""
    parts, meshes = [], []
    if inertial is not None:
        mass, *moments = format_numbers([inertial.mass, *inertial.moments]).split()
        parts.append(_INERTIAL.format(*moments, mass=mass, pose=format_pose(inertial.pose)))
    for index, solid in enumerate(solids):
        name = f"{solid.group}{index}"
        if solid.shape.kind in GEOMETRY:
            sizes = format_numbers(solid.shape.size).split()
            geometry = GEOMETRY[solid.shape.kind].format(*sizes)
            place, friction = format_pose(solid.pose), format_numbers([solid.friction])
            parts.append(_COLLISION.format(name=name, pose=place, geometry=geometry, mu=friction))
        else:
            meshes.append(_format_mesh(f"{model} {link} {name}", solid))
    return f'<link name="{link}">{format_pose(pose)}{"".join(parts)}</link>', meshes


def format_numbers(numbers: Iterable[float]) -> str:
    """Format numbers without rounding, separated by spaces."""
    return " ".join(repr(float(number)) for number in numbers)


def format_pose(pose: Pose) -> str:
    """Return a pose as SDF."""
    numbers = format_numbers((*pose.position, *pose.quaternion))
    return f'<pose rotation_format="quat_xyzw">{numbers}</pose>'


def _format_mesh(place: str, solid: Solid) -> str:
    if solid.shape.kind == "heightfield":
        vertices, triangles = _triangulate(solid.shape)
    else:
        vertices, triangles, *_ = convex_polyhedron(solid.shape.corners)
    pose = format_numbers([*solid.pose.position, *scalar_first(solid.pose)])
    counts = f"{len(vertices)} {len(triangles)}"
    points = format_numbers(vertices.ravel().tolist())
    corners = " ".join(map(str, triangles.ravel().tolist()))
    return f"{place} {pose} {counts} {points} {corners}"


def _triangulate(field: Shape) -> tuple[Array, NDArray[np.intp]]:
    points = height_points(field)
    rows, columns, _ = points.shape
    first = np.add.outer(columns * np.arange(rows - 1), np.arange(columns - 1)).ravel()
    right, above = first + 1, first + columns
    lower = np.stack([first, right, above], axis=1)
    upper = np.stack([right, above + 1, above], axis=1)
    return points.reshape(-1, 3), np.concatenate([lower, upper])


LIGHT = Inertial(1e-6, Pose(), (1e-9, 1e-9, 1e-9, 0.0, 0.0, 0.0))  # massless links; DART needs mass

_TYPES = {"continuous": "revolute"} | {name: name for name in ("fixed", "revolute", "prismatic")}


def format_robot(
    robot: Robot, index: int, frame: Pose, wheel_friction: float
) -> tuple[str, list[str]]:
    """Return a robot's model with the root link at ``frame``, and the requests for its meshes."""
    drive, model = robot.drive, f"robot{index}"
    root = etree.fromstring(merge_fixed_links(robot.urdf_elements(), drive.caster_links).encode())
    urdf = read_tree(root, robot.name)
    others = (name for name in urdf.shapes if name != urdf.root)
    links = {name: f"link{i}" for i, name in enumerate([urdf.root, *others])}
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


def _find_solids(
    robot: Robot, link: str, shapes: Collection[Shape], is_wheel: bool, wheel_friction: float
) -> list[Solid]:
    """Return the collision shapes of a link; exposed wheels have separate shapes for the ground."""
    casters = robot.drive.caster_links
    if not is_wheel and link not in casters:
        return [Solid(SOLID, shape, shape.pose, CHASSIS_FRICTION) for shape in shapes]
    friction = wheel_friction if is_wheel else 0.0
    rolling = list(shapes)
    if is_wheel and not skids(robot.drive):
        # Edge contacts of cylinders would change turning radii by up to 11 %.
        rolling = [
            Shape("sphere", shape.size[:1], shape.pose) if shape.kind == "cylinder" else shape
            for shape in shapes
        ]
    solids = [Solid(ROLLING, shape, shape.pose, friction) for shape in rolling]
    if link in robot.exposed_links:
        solids += [Solid(OBSTACLE, shape, shape.pose, CHASSIS_FRICTION) for shape in shapes]
    return solids


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
        raise SimulationError(
            f"joint {joint.name!r}: Gazebo has no {joint.type} joints; change its type"
        )
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


WALKER_KG = 80.0


@lru_cache(maxsize=KEPT_WORLDS)
def hold_standing(world: World, robots: int) -> World:
    """Return the world with all bodies fixed that cannot be moved before the mission ends."""
    # DART processes each movable body in every step, even at rest.
    if not (world.course.end_on_collision and world.is_level and robots == 1):
        return world
    return replace(world, bodies=tuple(map(_hold, world.bodies)))


def _hold(body: Body) -> Body:
    stands = body.mass is not None and lowest_point(body) <= GAP_M
    return replace(body, mass=None, inertia=None) if stands else body


def describe_scene(robots: Sequence[PlacedRobot], world: World, settings: Settings) -> bytes:
    """Return the content of the request to create a simulation of robots in a world."""
    sizes = () if world.crowd is None else world.crowd.sizes
    parts = [_format_walker(i, *size) for i, size in enumerate(sizes)]
    parts.append(_format_fixed([body for body in world.bodies if body.mass is None]))
    movable = (body for body in world.bodies if body.mass is not None)
    parts += [_format_movable(body, i) for i, body in enumerate(movable)]
    for i, (robot, home) in enumerate(robots):
        frame = _set_down(robot, home, world)
        parts.append(format_robot(robot, i, frame, settings.wheel_friction))
    models, meshes = [text for text, _ in parts], [mesh for _, more in parts for mesh in more]
    gain = lag_gain(settings.time_step, settings.steering_lag_s)
    head = f"{format_numbers([settings.time_step, world.gravity_mps2, gain])} {len(meshes)}"
    sdf = f'<sdf version="1.9"><world name="scene">{"".join(models)}</world></sdf>'
    return "\n".join([head, *meshes, sdf]).encode()


def _set_down(robot: Robot, home: tuple[float, float, float, float], world: World) -> Pose:
    """Return the pose of the root link with the wheels on the ground."""
    # A dropped robot would sink into the ground, and DART would need seconds to lift it.
    x, y, _, yaw = home
    (px, py, pz), (qx, qy, qz, qw) = home_frame(robot, (x, y, 0.0, yaw), world)
    pose = Pose((px, py, pz), (qx, qy, qz, qw))
    if not world.is_level:
        return pose
    corners = (pose.transform((a, b, 0.0)) for a, b in robot.outline.tolist())
    heights = (ground_height(world.bodies, (a, b)) for a, b, _ in corners)
    top = max((height for height in heights if height is not None), default=0.0)
    return Pose((x, y, top), pose.quaternion)


def _format_fixed(bodies: Sequence[Body]) -> tuple[str, list[str]]:
    """Merge all fixed bodies into one model, because DART processes each model in every step."""
    solids = []
    for body in bodies:
        group, friction = GROUND if body.is_ground else OBSTACLE, min(body.friction, MAX_FRICTION)
        solids += [Solid(group, shape, pose, friction) for shape, pose in body.placed]
    link, meshes = format_link("fixed", "link0", Pose(), None, solids)
    return f'<model name="fixed"><static>true</static>{link}</model>', meshes


def _format_movable(body: Body, index: int) -> tuple[str, list[str]]:
    mass, model = body.mass or 0.0, f"body{index}"
    moments = body.inertia or joint_moments(body.shapes, mass)
    inertial = Inertial(mass, Pose(), (*moments, 0.0, 0.0, 0.0))
    friction = min(body.friction, MAX_FRICTION)
    solids = [Solid(SOLID, shape, shape.pose, friction) for shape in body.shapes]
    link, meshes = format_link(model, "link0", Pose(), inertial, solids)
    return f'<model name="{model}">{format_pose(body.pose)}{link}</model>', meshes


def _format_walker(index: int, radius: float, height: float) -> tuple[str, list[str]]:
    model, frame = f"walker{index}", Pose((0.0, 0.0, height / 2.0 + WALKER_GAP_M))
    inertial = Inertial(WALKER_KG, Pose(), (WALKER_KG, WALKER_KG, WALKER_KG, 0.0, 0.0, 0.0))
    cylinder = Solid(WALKER, Shape("cylinder", (radius, height)), Pose(), MAX_FRICTION)
    carrier, _ = format_link(model, "carrier", Pose(), inertial, [])
    link, meshes = format_link(model, "link0", Pose(), inertial, [cylinder])
    ends = (("x", "world", "carrier", "1 0 0"), ("y", "carrier", "link0", "0 1 0"))
    joints = [
        f'<joint name="{name}" type="prismatic"><parent>{parent}</parent><child>{child}</child>'
        f"<axis><xyz>{axis}</xyz></axis></joint>"
        for name, parent, child, axis in ends
    ]
    parts = "".join([format_pose(frame), carrier, link, *joints])
    return f'<model name="{model}">{parts}</model>', meshes
