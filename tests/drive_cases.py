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


BODY = (
    '<inertial><origin xyz="0 0 0.3"/><mass value="20"/><inertia ixx="0.6" ixy="0" ixz="0" '
    'iyy="1" iyz="0" izz="1.2"/></inertial><collision><origin xyz="0 0 0.3"/><geometry>'
    '<box size="0.6 0.2 0.1"/></geometry></collision>'
)
HALF_M, SIDE_M = 0.4, 0.25  # wheelbase and track of a vehicle, halved


def vehicle(front: float, rear: float, steers: str) -> str:
    """Return the text of a robot with wheels of these radii [m], which ``steers`` front or rear."""
    parts = []
    for axle, radius, x in (("front", front, HALF_M), ("rear", rear, -HALF_M)):
        mass = '<inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial>'
        shape = f'<geometry><cylinder radius="{radius}" length="0.04"/></geometry>'
        body = f'{mass}<collision><origin rpy="1.5707963267948966 0 0"/>{shape}</collision>'
        for side, y in (("left", SIDE_M), ("right", -SIDE_M)):
            name, xyz, parent = f"{axle}_{side}", f"{x} {y} {radius}", "base"
            if axle == steers:
                parts.append(link(f"{name}_knuckle", mass))
                limit = '<limit lower="-0.6" upper="0.6" effort="90" velocity="9"/>'
                knuckle = joint(f"{name}_steer", f"{name}_knuckle", xyz, "revolute", more=Z + limit)
                parts.append(knuckle)
                xyz, parent = "0 0 0", f"{name}_knuckle"
            motor = Y + '<limit effort="60" velocity="40"/>'
            parts += [
                link(name, body),
                joint(f"{name}_joint", name, xyz, parent=parent, more=motor),
            ]
    return f'<robot name="r">{link("base", BODY)}{"".join(parts)}</robot>'
