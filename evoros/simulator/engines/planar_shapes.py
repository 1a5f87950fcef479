"""The shapes by which several robots in the plane see one another."""

from collections.abc import Sequence
from functools import lru_cache
from typing import TypeAlias

from lxml import etree

from evoros.base.arrays import Array
from evoros.formats.urdf.merging import merge_fixed_links
from evoros.formats.urdf.tree import read_tree
from evoros.geometry.shapes import Pose, Shape
from evoros.robot.model import Robot
from evoros.world.obstacles import sight_rows

_Description: TypeAlias = tuple[str, tuple[str, ...], tuple[str, ...], frozenset[str]]
"""A robot's text, the joints of its wheels, its casters, and the links that stick out."""


def list_shapes(robots: Sequence[Robot]) -> tuple[Array, Array, list[int]]:
    """Return the shapes of several robots for rays, their faces, and how many each robot has."""
    if len(robots) == 1:
        return *sight_rows([])[:2], [0]
    return _list_shapes(tuple(map(_describe, robots)))


def _describe(robot: Robot) -> _Description:
    drive = robot.drive
    wheels, casters = tuple(drive.wheel_joints), tuple(drive.caster_links)
    return robot.engine_text, wheels, casters, robot.exposed_links


@lru_cache(maxsize=64)
def _list_shapes(robots: tuple[_Description, ...]) -> tuple[Array, Array, list[int]]:
    solids = [_find_solids(*robot) for robot in robots]
    rows, faces, _ = sight_rows([solid for part in solids for solid in part])
    return rows, faces, list(map(len, solids))


def _find_solids(
    text: str, wheels: tuple[str, ...], casters: tuple[str, ...], exposed: frozenset[str]
) -> list[tuple[Shape, Pose]]:
    """Find the shapes that obstacles can touch, in the robot's frame, as engines load them."""
    elements = etree.fromstring(text.encode())
    root = etree.fromstring(merge_fixed_links(elements, casters).encode())
    urdf = read_tree(root, "robot")
    rolling = {urdf.joints[name].child for name in wheels} | set(casters)
    return [
        (shape, urdf.poses[link] @ shape.pose)
        for link, shapes in urdf.shapes.items()
        if link not in rolling or link in exposed
        for shape in shapes
    ]
