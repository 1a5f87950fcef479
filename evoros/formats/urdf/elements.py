"""Builds and modifies URDF elements: completes inertias, and merges rigidly connected links."""

import math
from collections.abc import Collection, Iterable, Sequence

import numpy as np
from lxml import etree
from lxml.etree import SubElement
from lxml.etree import _Element as Element

from evoros.base import elementary
from evoros.base.arrays import Array, length, principal_axes, product
from evoros.base.errors import list_names
from evoros.formats.strict_xml import element_error, find_child, require_child
from evoros.formats.urdf.parts import read_origin, read_shapes, read_tensor, read_value
from evoros.geometry.footprint import bottom_height, top_height
from evoros.geometry.polyhedron import point_tensor
from evoros.geometry.shapes import Pose, Shape


def set_origin(element: Element, pose: Pose) -> None:
    """Replace the ``<origin>`` of an element."""
    for origin in element.findall("origin"):
        element.remove(origin)
    rotation = pose.rotation
    pitch = elementary.asin(min(max(-float(rotation[2, 0]), -1.0), 1.0))
    if abs(rotation[2, 0]) < 1.0 - 1e-12:
        roll = elementary.atan2(rotation[2, 1], rotation[2, 2])
        yaw = elementary.atan2(rotation[1, 0], rotation[0, 0])
    else:  # roll and yaw have the same axis
        roll, yaw = 0.0, elementary.atan2(-rotation[0, 1], rotation[1, 1])
    xyz = " ".join(repr(float(coordinate)) for coordinate in pose.position)
    rpy = f"{roll!r} {pitch!r} {yaw!r}"
    element.insert(0, etree.Element("origin", xyz=xyz, rpy=rpy))


def build_collision(shape: Shape) -> Element:
    """Build the ``<collision>`` of a shape; only this package reads ``<convex>`` elements."""
    collision = etree.Element("collision")
    geometry = SubElement(collision, "geometry")
    numbers = [repr(float(length)) for length in shape.size]
    if shape.kind == "convex":
        corners = " ".join(repr(float(x)) for corner in shape.corners for x in corner)
        SubElement(geometry, "convex", corners=corners)
    elif shape.kind == "box":
        SubElement(geometry, "box", size=" ".join(numbers))
    else:
        names = ("radius", "length")[: len(numbers)]
        SubElement(geometry, shape.kind, dict(zip(names, numbers, strict=True)))
    set_origin(collision, shape.pose)
    return collision


def set_collisions(link: Element, shapes: Sequence[Shape]) -> None:
    """Replace the collision shapes of a link."""
    for collision in link.findall("collision"):
        link.remove(collision)
    link.extend([build_collision(shape) for shape in shapes])


def set_inertial(link: Element, mass: float, centre: Array, tensor: Array) -> None:
    """Set the ``<inertial>`` of a link: mass [kg], centre (3,) [m] and tensor (3, 3) [kg m2]."""
    for inertial in link.findall("inertial"):
        link.remove(inertial)
    moments, axes = principal_axes(tensor)
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "mass", value=repr(mass))
    xx, yy, zz = (repr(moment) for moment in moments.tolist())
    SubElement(inertial, "inertia", ixx=xx, iyy=yy, izz=zz, ixy="0", ixz="0", iyz="0")
    set_origin(inertial, Pose.from_matrix(centre.tolist(), axes))


def set_motor(joint: Element, kind: str, axis: Array, effort: float, velocity: float) -> None:
    """Make a joint rotate about ``axis`` (3,), with a maximum torque [N m] and rate [rad/s]."""
    joint.set("type", kind)
    for element in [*joint.findall("axis"), *joint.findall("mimic")]:
        joint.remove(element)
    SubElement(joint, "axis", xyz=" ".join(repr(float(x)) for x in axis))
    limit = require_limit(joint)
    limit.set("effort", repr(effort))
    limit.set("velocity", repr(velocity))


def add_fixed_joint(root: Element, name: str, parent: str, child: str, pose: Pose) -> None:
    """Fix one link to another; ``pose`` is the child frame in the parent frame."""
    joint = SubElement(root, "joint", name=name, type="fixed")
    SubElement(joint, "parent", link=parent)
    SubElement(joint, "child", link=child)
    set_origin(joint, pose)


def add_fixed_link(root: Element, name: str, parent: str, pose: Pose) -> Element:
    """Add an empty link on a fixed joint; ``pose`` is in the frame of ``parent``."""
    link = SubElement(root, "link", name=name)
    add_fixed_joint(root, f"{name}_joint", parent, name, pose)
    return link


def require_limit(joint: Element) -> Element:
    """Return the ``<limit>`` of a joint, added if missing."""
    limit = joint.find("limit")
    return SubElement(joint, "limit") if limit is None else limit


def merge_fixed_links(root: Element, kept: Collection[str] = ()) -> str:
    """Merge links on fixed joints into their parents, outermost first; return the XML.

    Links in ``kept`` stay separate, for example because of their friction. Visual elements and
    elements for other simulators are removed. The ``<robot>`` element ``root`` is modified in
    place.
    """
    etree.strip_elements(root, "visual", "gazebo", "material", "transmission")
    links = {str(link.get("name")): link for link in root.findall("link")}

    def find_outermost() -> Element | None:
        unmerged = {_end(joint, "parent") for joint in root.findall("joint")} | set(kept)
        fixed = root.iterfind("joint[@type='fixed']")
        return next((joint for joint in fixed if _end(joint, "child") not in unmerged), None)

    while (joint := find_outermost()) is not None:
        parent, child = (links[_end(joint, tag)] for tag in ("parent", "child"))
        _merge(parent, child, read_origin(joint))
        root.remove(joint)
        root.remove(child)
    _merge_inner(root, links, kept)
    return etree.tostring(root, encoding="unicode")


def _merge_inner(root: Element, links: dict[str, Element], kept: Collection[str]) -> None:
    """Merge the remaining fixed links, which carry movable or kept links."""
    for joint in root.findall("joint"):
        if joint.get("type") != "fixed" or _end(joint, "child") in kept:
            continue
        pose, parent, child = read_origin(joint), _end(joint, "parent"), _end(joint, "child")
        _merge(links[parent], links[child], pose)
        for carried in root.findall("joint"):
            if _end(carried, "parent") == child:
                set_origin(carried, pose @ read_origin(carried))
                require_child(carried, "parent").set("link", parent)
        root.remove(joint)
        root.remove(links[child])


def _end(joint: Element, tag: str) -> str:
    return str(require_child(joint, tag).get("link"))


def _merge(parent: Element, child: Element, pose: Pose) -> None:
    """Merge a child link into its parent; ``pose`` is the child frame in the parent frame."""
    for collision in child.findall("collision"):
        set_origin(collision, pose @ read_origin(collision))
        parent.append(collision)
    if child.find("inertial") is None:  # the link is only a frame
        return
    if parent.find("inertial") is None:
        set_inertial(parent, *_read_inertia(child, pose))
        return
    mass1, centre1, tensor1 = _read_inertia(parent, Pose())
    mass2, centre2, tensor2 = _read_inertia(child, pose)
    mass = mass1 + mass2
    centre = (mass1 * centre1 + mass2 * centre2) / mass
    tensor = tensor1 + point_tensor(mass1, centre1 - centre)
    tensor += tensor2 + point_tensor(mass2, centre2 - centre)
    set_inertial(parent, mass, centre, tensor)


def _read_inertia(link: Element, pose: Pose) -> tuple[float, Array, Array]:
    """Return the mass [kg], centre (3,) [m] and tensor (3, 3) [kg m2] of a placed link."""
    inertial = require_child(link, "inertial")
    frame = pose @ read_origin(inertial)
    rotation = frame.rotation
    tensor = product(product(rotation, read_tensor(require_child(inertial, "inertia"))), rotation.T)
    mass = read_value(require_child(inertial, "mass"), "value")
    return mass, np.array(frame.position), tensor


DENSITY_KG_M3 = 500.0  # density of parts without a mass, assumed hollow: between foam and plastic
_MIN_GYRATION_M = 1e-4
_DEFAULT_GYRATION_M = 0.02  # radius of gyration [m] of a link without shapes


def correct_inertias(robot: Element, extent_m: float) -> list[str]:
    """Replace impossible inertias; return one line per kind of problem.

    A link without a mass becomes a frame. A tensor is impossible if no body of positive density can
    have it, or if it implies mass outside the robot's extent [m].
    """
    massless, replaced, beyond = [], [], []
    for link in robot.findall("link"):
        inertial = find_child(link, "inertial")
        if inertial is None:
            continue
        mass = _read_mass(inertial)
        if mass == 0.0:
            link.remove(inertial)
            massless.append(str(link.get("name")))
            continue
        centre = np.array(read_origin(inertial).position)
        if length(centre) > extent_m:
            beyond.append(str(link.get("name")))
        if not _is_possible(inertial, mass, extent_m):
            set_inertial(link, mass, centre, _assume_tensor(link, mass))
            replaced.append(str(link.get("name")))
    notes = {
        "links with a mass of 0 are treated as frames": massless,
        "impossible inertias are replaced with inertias of boxes around the shapes": replaced,
        f"centres of mass are farther from their links than the robot's size ({extent_m:.3g} m), "
        "so they may not be in metres; write <origin> of <inertial> in metres": beyond,
    }
    return [f"{text}: {list_names(names)}" for text, names in notes.items() if names]


def _read_mass(inertial: Element) -> float:
    mass = find_child(inertial, "mass")
    value = 0.0 if mass is None else read_value(mass, "value", "0")
    if mass is not None and value < 0.0:
        problem = f"must be greater than 0 kg, not {value:g}"
        raise element_error(mass, problem, "write a positive value")
    return value


def _is_possible(inertial: Element, mass: float, extent_m: float) -> bool:
    inertia = find_child(inertial, "inertia")
    if inertia is None or any(inertia.get(name) is None for name in ("ixx", "iyy", "izz")):
        return False
    low, middle, high = principal_axes(read_tensor(inertia))[0].tolist()
    return bool(
        low > mass * _MIN_GYRATION_M * _MIN_GYRATION_M
        and low + middle >= high * (1.0 - 1e-9)
        and high <= mass * extent_m * extent_m
    )


def _assume_tensor(link: Element, mass: float) -> Array:
    shapes = read_shapes(link)
    if not shapes:
        return mass * _DEFAULT_GYRATION_M * _DEFAULT_GYRATION_M * np.eye(3)
    low, high = bounds_of((shape, shape.pose) for shape in shapes)
    return box_tensor(mass, high - low)


def box_tensor(mass: float, size: Array) -> Array:
    """Return the inertia tensor (3, 3) [kg m2] of a homogeneous box of ``size`` (3,) [m]."""
    squares = np.maximum(size, 1e-3) ** 2
    return np.asarray(mass / 12.0 * np.diag(squares.sum() - squares))


def bounds_of(shapes: Iterable[tuple[Shape, Pose]]) -> tuple[Array, Array]:
    """Return the minimum and maximum corner (3,) [m] of a bounding box around placed shapes."""
    turns = (  # rotations that make x, y and z vertical
        Pose.from_rpy((0.0, 0.0, 0.0), 0.0, -math.pi / 2, 0.0),
        Pose.from_rpy((0.0, 0.0, 0.0), math.pi / 2, 0.0, 0.0),
        Pose(),
    )
    placed = list(shapes)
    low = [min(bottom_height(shape, turn @ pose) for shape, pose in placed) for turn in turns]
    high = [max(top_height(shape, turn @ pose) for shape, pose in placed) for turn in turns]
    return np.array(low), np.array(high)


def give_mass(link: Element, shapes: Sequence[tuple[Shape, Pose]]) -> float:
    """Give a link the mass of its shapes' bounding box; return the mass [kg]."""
    low, high = bounds_of(shapes)
    mass = DENSITY_KG_M3 * float(np.prod(np.maximum(high - low, 1e-3)))
    set_inertial(link, mass, (low + high) / 2, box_tensor(mass, high - low))
    return mass
