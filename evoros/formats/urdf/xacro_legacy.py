"""Converts xacro from before 2014 to its current form, in the process that expands it.

Up to ROS Indigo, the tags of xacro needed no prefix, a macro could be called without one, and
properties and macros could be used before their definitions. Documents are parsed by minidom.
"""

from collections.abc import Iterator
from typing import Any

LEGACY_TAGS = {
    "arg": ("name", "default"),
    "if": ("value",),
    "include": ("filename",),
    "insert_block": ("name",),
    "macro": ("name",),
    "property": ("name",),
    "unless": ("value",),
}
"""Tags of xacro, with attributes that distinguish them from equally named tags of, say, SDF."""

_DEFINITIONS = ("xacro:property", "xacro:macro", "xacro:include")
_URDF = (
    *("robot", "link", "joint", "material", "origin", "parent", "child", "axis", "limit", "mimic"),
    *("calibration", "dynamics", "safety_controller", "inertial", "mass", "inertia", "visual"),
    *("collision", "geometry", "box", "cylinder", "sphere", "capsule", "mesh", "color", "texture"),
    *("contact", "verbose"),
)
_FOREIGN = ("gazebo", "transmission", "ros2_control", "sensor")
"""Elements with children that are neither URDF nor xacro."""


def add_prefixes(root: Any) -> Iterator[str]:
    """Add ``xacro:`` to the tags of a document that lack it; yield each of them."""
    for tag, attributes in LEGACY_TAGS.items():
        for element in root.getElementsByTagName(tag):
            if all(map(element.hasAttribute, attributes)):
                rename(element, tag)
                yield tag


def rename(element: Any, tag: str) -> None:
    """Give an element a tag of xacro."""
    element.tagName = element.nodeName = f"xacro:{tag}"


def move_definitions(root: Any) -> None:
    """Move properties, macros and includes, in this order, before all other elements."""
    elements = [child for child in root.childNodes if child.nodeType == child.ELEMENT_NODE]
    moved = [e for tag in _DEFINITIONS for e in elements if e.tagName == tag]
    for element in reversed(moved):
        root.removeChild(element)
        root.insertBefore(element, root.firstChild)


def calls_macro(element: Any, macros: Any) -> bool:
    """Return True if an element without a prefix can only be a macro call."""
    if element.tagName in _URDF or element.tagName not in macros:
        return False
    above = element.parentNode
    while above is not None and above.nodeType == above.ELEMENT_NODE:
        if above.tagName in _FOREIGN:
            return False
        above = above.parentNode
    document = element.ownerDocument.documentElement
    return bool(document is not None and document.tagName == "robot")
