"""Descriptions of robots on wheels, as people write them, for the tests of drives."""

from typing import Any

from lxml import etree

from evoros.drive.automatic import AutomaticDescription
from evoros.formats.urdf.tree import Urdf, read_tree

RADIUS = 0.05
ROUND = (
    f'<collision><origin rpy="1.5708 0 0"/><geometry><cylinder radius="{RADIUS}" length="0.03"/>'
    "</geometry></collision>"
)


def link(name: str, body: str = ROUND) -> str:
    return f'<link name="{name}">{body}</link>'


def joint(
    name: str, child: str, xyz: str, kind: str = "continuous", parent: str = "base", more: str = ""
) -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{more or Y}</joint>'


Y, Z = '<axis xyz="0 1 0"/>', '<axis xyz="0 0 1"/>'


def wheel(name: str, xyz: str, **more: str) -> str:
    return link(f"{name}_wheel") + joint(f"{name}_wheel_joint", f"{name}_wheel", xyz, **more)


def read(*parts: str) -> Urdf:
    text = f'<robot name="r"><link name="base"/>{"".join(parts)}</robot>'
    return read_tree(etree.fromstring(text), "r.urdf")


def choose(*parts: str, **values: Any) -> Any:
    return AutomaticDescription(**values).choose(read(*parts))


PAIR = wheel("left", "0 0.1 0.05") + wheel("right", "0 -0.1 0.05")
FRONT = wheel("fl", "0.2 0.1 0.05") + wheel("fr", "0.2 -0.1 0.05")
REAR = wheel("rl", "-0.2 0.1 0.05") + wheel("rr", "-0.2 -0.1 0.05")


def steered(kind: str, limit: str) -> str:
    parts = []
    for side, y in (("left", 0.1), ("right", -0.1)):
        hinge = f"{side}_steering_hinge"
        parts.append(link(hinge, ""))
        parts.append(joint(f"{hinge}_joint", hinge, f"0.2 {y} 0.05", kind, more=Z + limit))
        parts.append(wheel(f"front_{side}", "0 0 0", parent=hinge))
    return "".join(parts)


LIMIT = '<limit lower="-0.6" upper="0.6" effort="1" velocity="1"/>'
