"""Merges links that cannot move against each other: engines take time for every link."""

import math
from collections.abc import Collection

import numpy as np
from lxml import etree
from lxml.etree import _Element as Element

from evoros.base.arrays import Array
from evoros.formats.strict_xml import require_child
from evoros.formats.urdf.parts import read_origin, read_tensor, read_value
from evoros.geometry.inertia import point_tensor
from evoros.geometry.shapes import Pose


def merge_fixed_links(root: Element, kept: Collection[str] = ()) -> str:
    """Merge every outermost link on a fixed joint into its parent; return the text.

    The merged link has the mass, centre of mass, inertia and collision shapes of both. Links in
    ``kept`` stay separate, for example because their friction differs. Visual elements and those
    for other simulators are removed. ``root``, a ``<robot>``, is changed in place.
    """
    etree.strip_elements(root, "visual", "gazebo", "material", "transmission")
    links = {str(link.get("name")): link for link in root.findall("link")}
    while (joint := _find_outermost(root, kept)) is not None:
        parent, child = (links[_end(joint, tag)] for tag in ("parent", "child"))
        _merge(parent, child, read_origin(joint))
        root.remove(joint)
        root.remove(child)
    return etree.tostring(root, encoding="unicode")


def _end(joint: Element, tag: str) -> str:
    return str(require_child(joint, tag).get("link"))


def _find_outermost(root: Element, kept: Collection[str]) -> Element | None:
    """Find a fixed joint whose child carries nothing and is not in ``kept``."""
    unmerged = {_end(joint, "parent") for joint in root.findall("joint")} | set(kept)
    for joint in root.findall("joint"):
        if joint.get("type") == "fixed" and _end(joint, "child") not in unmerged:
            return joint
    return None


def _merge(parent: Element, child: Element, pose: Pose) -> None:
    """Merge a child into its parent; ``pose`` is that of the child's frame in the parent's."""
    for collision in child.findall("collision"):
        _set_origin(collision, pose @ read_origin(collision))
        parent.append(collision)
    mass1, centre1, tensor1 = _read_inertia(parent, Pose())
    mass2, centre2, tensor2 = _read_inertia(child, pose)
    mass = mass1 + mass2
    centre = (mass1 * centre1 + mass2 * centre2) / mass
    tensor = tensor1 + point_tensor(mass1, centre1 - centre)
    tensor += tensor2 + point_tensor(mass2, centre2 - centre)
    for inertial in parent.findall("inertial"):
        parent.remove(inertial)
    parent.append(_build_inertial(mass, centre, tensor))


def _build_inertial(mass: float, centre: Array, tensor: Array) -> Element:
    """Build the ``<inertial>`` of a mass [kg], centre (3,) [m] and tensor (3, 3) [kg m2]."""
    moments, axes = np.linalg.eigh(tensor)
    axes[:, 2] *= math.copysign(1.0, float(np.linalg.det(axes)))  # right-handed
    inertial = etree.Element("inertial")
    etree.SubElement(inertial, "mass", value=repr(mass))
    xx, yy, zz = (repr(moment) for moment in moments.tolist())
    etree.SubElement(inertial, "inertia", ixx=xx, iyy=yy, izz=zz, ixy="0", ixz="0", iyz="0")
    _set_origin(inertial, Pose.from_matrix(centre.tolist(), axes))
    return inertial


def _read_inertia(link: Element, pose: Pose) -> tuple[float, Array, Array]:
    """Read mass [kg], centre of mass (3,) [m] and tensor about it (3, 3) [kg m2].

    ``pose`` is that of the link's frame in the frame of the result.
    """
    inertial = require_child(link, "inertial")
    frame = pose @ read_origin(inertial)
    rotation = frame.rotation
    tensor = rotation @ read_tensor(require_child(inertial, "inertia")) @ rotation.T
    mass = read_value(require_child(inertial, "mass"), "value")
    return mass, np.array(frame.position), tensor


def _set_origin(element: Element, pose: Pose) -> None:
    for origin in element.findall("origin"):
        element.remove(origin)
    rotation = pose.rotation
    pitch = math.asin(min(max(-float(rotation[2, 0]), -1.0), 1.0))
    if abs(rotation[2, 0]) < 1.0 - 1e-12:
        roll = math.atan2(rotation[2, 1], rotation[2, 2])
        yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    else:  # roll and yaw turn about the same axis
        roll, yaw = 0.0, math.atan2(-rotation[0, 1], rotation[1, 1])
    xyz = " ".join(repr(float(coordinate)) for coordinate in pose.position)
    rpy = f"{roll!r} {pitch!r} {yaw!r}"
    element.insert(0, etree.Element("origin", xyz=xyz, rpy=rpy))
