"""Converts SDF 1.0 (Gazebo 1.0, 2012) to later elements, as sdformat's ``1_0.convert`` does."""

from lxml import etree
from lxml.etree import _Element as Element

from evoros.formats.notes import Notes

_POSED = ["model", "link", "inertial", "collision", "visual", "joint", "light", "actor", "sensor"]
_TO_CHILDREN = {
    "model": "static",
    "include": "filename",
    "link": "gravity self_collide kinematic",
    "inertial": "mass density",
    "inertia": "ixx ixy ixz iyy iyz izz",
    "collision": "laser_retro",
    "ode": "mu mu2 fdir1 slip1 slip2 soft_cfm soft_erp kp kd max_vel min_depth",
    "bounce": "restitution_coefficient threshold",
    "box": "size",
    "sphere": "radius",
    "cylinder": "radius length",
    "plane": "normal",
    "mesh": "filename scale",
    "heightmap": "filename size origin",
    "image": "filename scale threshold height granularity",
    "axis": "xyz",
    "axis2": "xyz",
    "limit": "lower upper effort velocity",
    "dynamics": "damping friction",
}
_RENAMED = {("include", "filename"): "uri", ("heightmap", "origin"): "pos"}
_TO_TEXT = {"gravity": "xyz", "parent": "link", "child": "link"}


def modernize(root: Element, notes: Notes) -> None:
    """Convert a document of SDF 1.0 or 1.1 in place; leave other versions unchanged."""
    if root.get("version", "").strip() not in ("1.0", "1.1"):
        return
    rewritten = sum(_rewrite(element) for element in [*root.iter(etree.Element)])
    if rewritten:
        problem = f"is SDF {root.get('version')}; attributes read as elements: {rewritten}"
        notes.add(root, problem, "old version")


def _rewrite(element: Element) -> int:
    tag = str(element.tag)
    count = 0
    for name in _TO_CHILDREN.get(tag, "").split():
        count += _move(element, name, element, _RENAMED.get((tag, name), name))
    if tag in _POSED:
        for origin in element.findall("origin"):
            count += _move(origin, "pose", element, "pose")
            element.remove(origin)
    text = element.get(_TO_TEXT.get(tag, tag))
    if tag in _TO_TEXT and text is not None and not (element.text or "").strip():
        element.text = text
        count += 1
    return count


def _move(source: Element, attribute: str, owner: Element, tag: str) -> bool:
    text = source.attrib.pop(attribute, None)
    if text is None or owner.find(tag) is not None:
        return False
    child = etree.SubElement(owner, tag)
    child.text = text
    child.sourceline = source.sourceline  # type: ignore[misc]  # the stubs know no setter
    return True
