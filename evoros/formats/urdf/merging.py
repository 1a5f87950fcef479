"""Merges links that cannot move against each other: engines take time for every link."""

from collections.abc import Collection

import numpy as np
from lxml import etree
from lxml.etree import _Element as Element

from evoros.base.arrays import Array
from evoros.base.linear import product
from evoros.formats.strict_xml import require_child
from evoros.formats.urdf.elements import set_inertial, set_origin
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
    _merge_inner(root, links, kept)
    return etree.tostring(root, encoding="unicode")


def _merge_inner(root: Element, links: dict[str, Element], kept: Collection[str]) -> None:
    """Merge the remaining fixed links, which carry links that move or are kept."""
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


def _find_outermost(root: Element, kept: Collection[str]) -> Element | None:
    """Find a fixed joint whose child carries nothing and is not in ``kept``."""
    unmerged = {_end(joint, "parent") for joint in root.findall("joint")} | set(kept)
    fixed = root.iterfind("joint[@type='fixed']")
    return next((joint for joint in fixed if _end(joint, "child") not in unmerged), None)


def _merge(parent: Element, child: Element, pose: Pose) -> None:
    """Merge a child into its parent; ``pose`` places the child's frame in the parent's."""
    for collision in child.findall("collision"):
        set_origin(collision, pose @ read_origin(collision))
        parent.append(collision)
    if child.find("inertial") is None:  # a frame
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
    """Read mass [kg], centre of mass (3,) [m] and tensor about it (3, 3) [kg m2].

    ``pose`` places the link's frame in the frame of the result.
    """
    inertial = require_child(link, "inertial")
    frame = pose @ read_origin(inertial)
    rotation = frame.rotation
    tensor = product(product(rotation, read_tensor(require_child(inertial, "inertia"))), rotation.T)
    mass = read_value(require_child(inertial, "mass"), "value")
    return mass, np.array(frame.position), tensor
