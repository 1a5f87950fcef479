"""The arrays of several robots in the plane: those of each robot, one after another, and more.

``parameters`` holds the number of robots, a row of ROW_SIZE numbers for each robot, a last row with
the ends, then the parameters of each robot as in ``planar_layout``, then the shapes by which the
robots see one another. ``memory`` holds that of each robot, then these shapes where they are.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from lxml import etree

from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.formats.urdf.merging import merge_fixed_links
from evoros.formats.urdf.tree import read_tree
from evoros.geometry.ray import AT_X, AT_Y, BOUND, FACE_SIZE, OBSTACLE_SIZE
from evoros.geometry.shapes import Pose, Shape
from evoros.robot.model import Robot
from evoros.simulator.engines.planar_beams import BEAM_SIZE
from evoros.simulator.engines.planar_layout import BEAMS, block, measure_sight
from evoros.world.obstacles import sight_rows

PARAMETERS, MEMORY, SIGNALS, SHAPES, SIGHT, EXTENT = range(6)
"""A robot: where its parameters, its memory, its signals and its shapes begin; how far [m] from its
origin its sensors see, and how far its shapes reach."""
ROW_SIZE = 6


@compilable
def table_of(parameters: Array) -> Array:
    """Return the rows (n + 1, ROW_SIZE) of the robots; the last one has the ends."""
    return parameters[1 : 1 + (int(parameters[0]) + 1) * ROW_SIZE].reshape((-1, ROW_SIZE))


@compilable
def part(array: Array, table: Array, number: int, column: int) -> Array:
    """Return the part of an array, by the column of its starts, that one of the robots has."""
    return array[int(table[number, column]) : int(table[number + 1, column])]


@compilable
def shapes_of(parameters: Array, table: Array) -> tuple[Array, Array]:
    """Return the robots' shapes in their frames (s, OBSTACLE_SIZE), and the faces of polyhedra."""
    start = int(table[-1, PARAMETERS])
    end = start + int(table[-1, SHAPES]) * OBSTACLE_SIZE
    return (
        parameters[start:end].reshape((-1, OBSTACLE_SIZE)),
        parameters[end:].reshape((-1, FACE_SIZE)),
    )


def lay_out_team(
    robots: Sequence[Robot], parameters: Sequence[Array], memories: Sequence[Array]
) -> tuple[Array, Array]:
    """Return the parameters and the memory of several robots, from those of each."""
    shapes, counts, faces = _list_shapes(tuple(map(_describe, robots)))
    table = np.zeros((len(robots) + 1, ROW_SIZE))
    first = 1 + table.size
    table[:, PARAMETERS] = first + _sum([len(each) for each in parameters])
    table[:, MEMORY] = _sum([len(each) for each in memories])
    table[:, SIGNALS] = _sum([robot.signal_count for robot in robots])
    table[:, SHAPES] = _sum(counts)
    for row, each, end in zip(table, parameters, table[1:, SHAPES], strict=False):
        row[SIGHT] = measure_sight(block(each, BEAMS).reshape(-1, BEAM_SIZE))
        own = shapes[int(row[SHAPES]) : int(end)]
        x, y = own[:, AT_X], own[:, AT_Y]
        row[EXTENT] = (np.sqrt(x * x + y * y) + own[:, BOUND]).max()
    head = [float(len(robots))], table.ravel()
    return (
        np.concatenate([*head, *parameters, shapes.ravel(), faces.ravel()]),
        np.concatenate([*memories, np.zeros(shapes.size)]),
    )


def _sum(sizes: Sequence[int]) -> Array:
    """Return where parts of these sizes begin, and where the last one ends."""
    return np.cumsum([0, *sizes]).astype(np.float64)


class _Description(NamedTuple):
    """What the shapes of a robot depend on."""

    text: str
    wheels: tuple[str, ...]  # joints
    casters: tuple[str, ...]
    exposed: frozenset[str]


def _describe(robot: Robot) -> _Description:
    drive = robot.drive
    wheels, casters = tuple(drive.wheel_joints), tuple(drive.caster_links)
    return _Description(robot.engine_text, wheels, casters, robot.exposed_links)


@lru_cache(maxsize=64)
def _list_shapes(robots: tuple[_Description, ...]) -> tuple[Array, list[int], Array]:
    """Return the shapes of robots for rays, how many each has, and the faces of polyhedra."""
    solids = [_find_solids(robot) for robot in robots]
    rows, faces, _ = sight_rows([solid for own in solids for solid in own])
    return rows, [len(own) for own in solids], faces


def _find_solids(robot: _Description) -> list[tuple[Shape, Pose]]:
    """Find the shapes that obstacles can touch, in the robot's frame, as engines load them."""
    elements = etree.fromstring(robot.text.encode())
    root = etree.fromstring(merge_fixed_links(elements, robot.casters).encode())
    urdf = read_tree(root, "robot")
    rolling = {urdf.joints[name].child for name in robot.wheels} | set(robot.casters)
    return [
        (shape, urdf.poses[link] @ shape.pose)
        for link, shapes in urdf.shapes.items()
        if link not in rolling or link in robot.exposed
        for shape in shapes
    ]
