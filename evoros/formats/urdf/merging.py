"""Links that cannot move against each other, made one: engines pay for every link."""

import math
from collections.abc import Collection

import numpy as np
from lxml import etree
from lxml.etree import _Element as Element

from evoros.base.arrays import Array
from evoros.formats.urdf.parts import read_origin, value
from evoros.geometry.shapes import Pose


def merge_fixed_links(urdf: str, kept: Collection[str] = ()) -> str:
    """The description with every outermost link on a fixed joint made part of its parent.

    Links that are ``kept`` stay links of their own, for example where their friction differs.

    Mass, centre of mass and inertia are those of both together; collision shapes move along.
    What is only seen, and what is meant for other simulators, is left out.
    """
    root = etree.fromstring(urdf.encode())
    etree.strip_elements(root, "visual", "gazebo", "material", "transmission")
    links = {str(link.get("name")): link for link in root.findall("link")}
    while (joint := _outermost(root, kept)) is not None:
        parent, child = (links[_end(joint, tag)] for tag in ("parent", "child"))
        _merge(parent, child, read_origin(joint))
        root.remove(joint)
        root.remove(child)
    return etree.tostring(root, encoding="unicode")


def _end(joint: Element, tag: str) -> str:
    end = joint.find(tag)
    assert end is not None  # the description was checked when it was read
    return str(end.get("link"))


def _outermost(root: Element, kept: Collection[str]) -> Element | None:
    """A fixed joint whose child carries nothing and is not kept."""
    staying = {_end(joint, "parent") for joint in root.findall("joint")} | set(kept)
    for joint in root.findall("joint"):
        if joint.get("type") == "fixed" and _end(joint, "child") not in staying:
            return joint
    return None


def _merge(parent: Element, child: Element, place: Pose) -> None:
    """``place`` is that of the child's frame in the parent's."""
    for collision in child.findall("collision"):
        _set_origin(collision, place @ read_origin(collision))
        parent.append(collision)
    (mass1, center1, tensor1), (mass2, center2, tensor2) = _inertia(parent), _inertia(child, place)
    mass = mass1 + mass2
    center = (mass1 * center1 + mass2 * center2) / mass
    tensor = tensor1 + _steiner(mass1, center1 - center)
    tensor += tensor2 + _steiner(mass2, center2 - center)
    moments, axes = np.linalg.eigh(tensor)
    axes[:, 2] *= math.copysign(1.0, float(np.linalg.det(axes)))  # right-handed
    inertial = etree.Element("inertial")
    etree.SubElement(inertial, "mass", value=repr(mass))
    x, y, z = (repr(moment) for moment in moments.tolist())
    etree.SubElement(inertial, "inertia", ixx=x, iyy=y, izz=z, ixy="0", ixz="0", iyz="0")
    _set_origin(inertial, Pose.from_matrix(center.tolist(), axes))
    for old in parent.findall("inertial"):
        parent.remove(old)
    parent.append(inertial)


def _inertia(link: Element, place: Pose | None = None) -> tuple[float, Array, Array]:
    """Mass [kg], centre of mass (3,) [m] and tensor about it (3, 3) [kg m2] in a frame."""
    inertial = link.find("inertial")
    assert inertial is not None
    mass, tensor = inertial.find("mass"), inertial.find("inertia")
    assert mass is not None
    assert tensor is not None
    frame = (place or Pose()) @ read_origin(inertial)
    xx, yy, zz = (value(tensor, name) for name in ("ixx", "iyy", "izz"))
    xy, xz, yz = (value(tensor, name, "0") for name in ("ixy", "ixz", "iyz"))
    own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    turn = frame.rotation
    return value(mass, "value"), np.array(frame.position), turn @ own @ turn.T


def _steiner(mass: float, offset: Array) -> Array:
    """What a point mass adds to the tensor about the point from which it is ``offset`` [m]."""
    added: Array = mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    return added


def _set_origin(element: Element, pose: Pose) -> None:
    for old in element.findall("origin"):
        element.remove(old)
    turn = pose.rotation
    pitch = math.asin(min(max(-float(turn[2, 0]), -1.0), 1.0))
    if abs(turn[2, 0]) < 1.0 - 1e-12:
        roll = math.atan2(turn[2, 1], turn[2, 2])
        yaw = math.atan2(turn[1, 0], turn[0, 0])
    else:  # roll and yaw turn about the same axis
        roll, yaw = 0.0, math.atan2(-turn[0, 1], turn[1, 1])
    xyz = " ".join(repr(float(part)) for part in pose.position)
    rpy = f"{roll!r} {pitch!r} {yaw!r}"
    element.insert(0, etree.Element("origin", xyz=xyz, rpy=rpy))
