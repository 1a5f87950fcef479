"""What moves besides robots in the plane: bodies that they push, and walkers.

Their parameters, and where they are in a mission.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple, TypeAlias

import numpy as np

from evoros.base.arrays import NO_VALUES, Array, Matrix
from evoros.base.compilable import compilable
from evoros.geometry.footprint import bottom_height, project_shape, top_height
from evoros.geometry.grid import GRID_SIZE, Grid
from evoros.geometry.outlines import FOOTPRINT_SIZE, Outlines
from evoros.geometry.polygon import transform_polygon
from evoros.geometry.ray import FACE_SIZE, OBSTACLE_SIZE, place_obstacle
from evoros.geometry.shapes import Body, Pose
from evoros.world.model import KEPT_WORLDS, World
from evoros.world.movable import Pushable, split_obstacles
from evoros.world.obstacles import sight_rows
from evoros.world.standing import standing_obstacles

START_X, START_Y, BODY_RADIUS, ARM_SQUARED, FRICTION, LOAD, FIRST_PART, END_PART = range(8)
"""A body: where its centre of mass is at first [m]; its radius [m] about that; the square of the
arm [m2] of its friction about the vertical; its coefficient of friction; that times its mass [kg];
its first part and the one after its last."""
BODY_SIZE = 8
RADIUS, START, END, BOTTOM, TOP = range(5)
"""A part: the radius around its corners [m], its first corner and the one after its last, and its
lowest and highest point [m]."""
PART_SIZE = 5
FIXED_BOTTOM, FIXED_TOP = FOOTPRINT_SIZE, FOOTPRINT_SIZE + 1
"""A fixed shape: a footprint as in ``evoros.geometry.outlines``, its lowest and highest point."""
FIXED_SIZE = FOOTPRINT_SIZE + 2

BODY_X, BODY_Y, BODY_COS, BODY_SIN = range(4)
"""The pose of a body: its centre of mass [m], and cosine and sine of its turn since the start."""
POSE_SIZE = 4

PlanarPose: TypeAlias = tuple[float, float, float, float]
"""x, y [m], and the cosine and sine of the heading."""

MAX_FRICTION = 1.0  # as in PyBullet, whose chassis has friction 1


class Movables(NamedTuple):
    """The bodies that can be pushed, the obstacles that stop them, and the walkers."""

    bodies: Matrix  # (b, BODY_SIZE)
    parts: Matrix  # (s, PART_SIZE), the shapes of the bodies
    corners: Matrix  # (c, 2) [m] from the centre of mass of their body, of the parts
    sights: Matrix  # (s, OBSTACLE_SIZE), of the parts, from the centre of mass of their body
    faces: Matrix  # of polyhedra, as in evoros.geometry.ray
    grid: Array  # as in evoros.geometry.grid
    starts: Array  # by cell of the grid, its first of the entries
    entries: Array  # rows of ``fixed`` within reach of the bodies
    fixed: Matrix  # (f, FIXED_SIZE), the obstacles that stay
    fixed_corners: Matrix  # (c, 2) [m], of ``fixed``
    walk: Array = NO_VALUES  # a packed Walk


class Placed(NamedTuple):
    """Where the bodies and the walkers are in a mission."""

    poses: Matrix  # (b, POSE_SIZE)
    saved: Matrix  # (b, POSE_SIZE) before the step
    levels: Array  # (b,) how far from the robot in the chain of those that push each other, or 0
    corners: Matrix  # (c, 2) [m], of the parts
    sights: Matrix  # (s, OBSTACLE_SIZE), of the parts, and then of the walkers
    robots: Matrix  # (r, 4), where walkers find the robots
    walking: Array = NO_VALUES  # a packed Walking


@lru_cache(maxsize=KEPT_WORLDS)
def can_push(world: World) -> bool:
    """Whether missions in a world go on after contact, and it has bodies that can be moved."""
    movable = any(body.mass is not None for body in world.obstacles)
    return movable and not world.course.end_on_collision


@lru_cache(maxsize=64)
def find_movables(world: World, tallest: float) -> tuple[tuple[Body, ...], Movables]:
    """Return the obstacles that stay, and the bodies that a robot of this height [m] can push.

    Nothing moves in a world whose missions end at the first contact.
    """
    fixed, pushable = split_obstacles(world, tallest) if can_push(world) else ((), ())
    if not pushable:
        nothing = np.zeros((0, BODY_SIZE)), np.zeros((0, PART_SIZE)), np.zeros((0, 2))
        sights = np.zeros((0, OBSTACLE_SIZE)), np.zeros((0, FACE_SIZE))
        still = np.zeros(0), np.zeros(0), np.zeros((0, FIXED_SIZE)), np.zeros((0, 2))
        return standing_obstacles(world), Movables(*nothing, *sights, np.zeros(GRID_SIZE), *still)
    reach = max(body.radius for body in pushable)
    return fixed, Movables(*_lay_out_bodies(pushable), *_lay_out_fixed(fixed, reach))


def _lay_out_bodies(pushable: Sequence[Pushable]) -> tuple[Array, ...]:
    """Return the fields of Movables from ``bodies`` to ``faces``."""
    bodies, parts, corners, solids, first, count = [], [], [], [], 0, 0
    for body, shapes, radius, arm in pushable:
        x, y, _ = body.pose.position
        friction = min(body.friction, MAX_FRICTION)
        load = friction * (body.mass or 0.0)
        bodies.append([x, y, radius, arm * arm, friction, load, first, first + len(shapes)])
        first += len(shapes)
        for part in shapes:
            end = count + len(part.area.vertices)
            parts.append([part.area.radius, count, end, part.bottom, part.top])
            corners.append(part.area.vertices - (x, y))
            solids.append((part.shape, Pose((-x, -y, 0.0)) @ part.pose))
            count = end
    sights, faces, _ = sight_rows(solids)
    return np.array(bodies), np.array(parts), np.concatenate(corners), sights, faces


def _lay_out_fixed(fixed: Sequence[Body], reach: float) -> tuple[Array, ...]:
    """Return the fields of Movables from ``grid`` to ``fixed_corners``."""
    solids = [(s, body.pose @ s.pose) for body in fixed for s in body.shapes if s.kind != "plane"]
    areas = [project_shape(shape, pose) for shape, pose in solids]
    heights = [(bottom_height(shape, pose), top_height(shape, pose)) for shape, pose in solids]
    grid, outlines = Grid.around(areas, reach), Outlines.of(areas)
    rows = np.concatenate([outlines.rows, np.array(heights).reshape(-1, 2)], axis=1)
    return grid.to_array(), *grid.list_near(areas, reach), rows, outlines.corners


def place_bodies(movables: Movables) -> Placed:
    """Return the bodies where they stand at first."""
    bodies = movables.bodies
    poses = np.zeros((len(bodies), POSE_SIZE))
    poses[:, [BODY_X, BODY_Y]] = bodies[:, [START_X, START_Y]]
    poses[:, BODY_COS] = 1.0
    arrays = np.zeros_like(movables.corners), np.zeros_like(movables.sights), np.zeros((0, 4))
    placed = Placed(poses, poses.copy(), np.zeros(len(bodies)), *arrays)
    for index in range(len(bodies)):
        place_body(movables, placed, index)
    return placed


@compilable
def place_body(movables: Movables, placed: Placed, index: int) -> None:
    """Move the corners and the shapes for rays of a body to its pose."""
    x, y, cos, sin = pose_of(placed, index)
    body = movables.bodies[index]
    for i in range(int(body[FIRST_PART]), int(body[END_PART])):
        start = int(movables.parts[i, START])
        end = int(movables.parts[i, END])
        corners = movables.corners[start:end]
        transform_polygon(corners, x, y, cos, sin, placed.corners[start:end])
        place_obstacle(movables.sights[i], x, y, cos, sin, placed.sights[i])


@compilable
def pose_of(placed: Placed, index: int) -> PlanarPose:
    """Return the pose of a body."""
    pose = placed.poses[index]
    return pose[BODY_X], pose[BODY_Y], pose[BODY_COS], pose[BODY_SIN]
