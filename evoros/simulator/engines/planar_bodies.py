"""Movable bodies and walkers in the plane: parameters, and poses in a mission."""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple, TypeAlias

import numpy as np

from evoros.base.arrays import NO_VALUES, Array, Matrix
from evoros.base.compilable import compilable
from evoros.geometry import footprint
from evoros.geometry.grid import GRID_SIZE, Grid
from evoros.geometry.polygon import polygon_contact, transform_polygon
from evoros.geometry.ray import FACE_SIZE, OBSTACLE_SIZE, place_obstacle
from evoros.geometry.shapes import Body, Pose
from evoros.world.model import KEPT_WORLDS, World
from evoros.world.standing import GAP_M, Part, place_parts, sight_rows, standing_obstacles

OVERLAP_M = 1e-3  # minimum overlap [m] in top view at which one body carries another


class Pushable(NamedTuple):
    """A movable body that stands on the ground and touches no other body."""

    body: Body
    parts: tuple[Part, ...]
    radius: float  # [m], about the centre of mass
    arm: float  # [m], ratio of the maximum friction moment to the maximum friction force


def split_obstacles(world: World, height_m: float) -> tuple[tuple[Body, ...], tuple[Pushable, ...]]:
    """Return the fixed obstacles, and the bodies that a robot of ``height_m`` can push."""
    bodies = standing_obstacles(world)
    parts = [place_parts(body, height_m) for body in bodies]
    fixed, pushable = [], []
    for i, body in enumerate(bodies):
        others = [part for j, other in enumerate(parts) if j != i for part in other]
        stands = body.mass is not None and min(part.bottom for part in parts[i]) <= GAP_M
        if stands and all(_penetration(a, b) <= OVERLAP_M for b in others for a in parts[i]):
            pushable.append(_describe(body, parts[i]))
        else:
            fixed.append(body)
    return tuple(fixed), tuple(pushable)


def _penetration(first: Part, second: Part) -> float:
    """Return the overlap [m] of two shapes in top view; 0 if their height ranges are disjoint."""
    if first.bottom > second.top + GAP_M or second.bottom > first.top + GAP_M:
        return 0.0
    (ax, ay, reach), (bx, by, other) = (
        footprint.bounding_circle(first.area),
        footprint.bounding_circle(second.area),
    )
    if math.hypot(bx - ax, by - ay) >= reach + other:
        return 0.0
    a, b = first.area, second.area
    return polygon_contact(a.vertices, b.vertices, a.radius, b.radius)[0]


def _describe(body: Body, parts: tuple[Part, ...]) -> Pushable:
    centre = np.array(body.pose.position[:2])
    circles = [footprint.bounding_circle(part.area) for part in parts]
    radius = max(math.dist((x, y), centre) + reach for x, y, reach in circles)
    lowest = min(part.bottom for part in parts)
    carrying = [part.area for part in parts if part.bottom <= lowest + GAP_M]
    return Pushable(body, parts, radius, _friction_arm(carrying, centre))


def _friction_arm(areas: Sequence[footprint.Footprint], centre: Array) -> float:
    """Return the mean distance [m] of supports from the centre of mass, as moment over force."""
    arms = [np.linalg.norm(area.vertices - centre, axis=1) for area in areas]
    rims = [area.radius for area in areas]
    points = [math.hypot(a, rim) for arm, rim in zip(arms, rims, strict=True) for a in arm.tolist()]
    return math.fsum(points) / len(points)


START_X, START_Y, BODY_RADIUS, ARM_SQUARED, FRICTION, LOAD, FIRST_PART, END_PART = range(8)
"""Columns of a body: centre of mass [m]; radius about it [m]; squared friction arm [m2]; friction
coefficient, and times mass [kg]; index of the first part, and after the last.
"""
BODY_SIZE = 8
RADIUS, START, END, BOTTOM, TOP = range(5)
"""Columns of a part: radius around the corners [m], index of the first corner, and after the last,
heights of the lowest and highest point [m].
"""
PART_SIZE = 5
FIXED_BOTTOM, FIXED_TOP = footprint.FOOTPRINT_SIZE, footprint.FOOTPRINT_SIZE + 1
"""Columns of a fixed shape after its footprint: heights of its lowest and highest point [m]."""
FIXED_SIZE = footprint.FOOTPRINT_SIZE + 2

BODY_X, BODY_Y, BODY_COS, BODY_SIN = range(4)
"""Columns of a body's pose: centre of mass [m]; cosine and sine of the rotation since the start."""
POSE_SIZE = 4

PlanarPose: TypeAlias = tuple[float, float, float, float]  # x, y [m]; heading's cosine, sine

MAX_FRICTION = 1.0  # friction coefficient of PyBullet's chassis


class Movables(NamedTuple):
    """The bodies that can be pushed, the obstacles that stop them, and the walkers."""

    bodies: Matrix  # (b, BODY_SIZE)
    parts: Matrix  # (s, PART_SIZE), shapes of the bodies
    corners: Matrix  # (c, 2) [m], corners of the parts, relative to the body's centre of mass
    sights: Matrix  # (s, OBSTACLE_SIZE), parts for rays, relative to their body's centre of mass
    faces: Matrix  # faces of polyhedra, see evoros.geometry.ray
    grid: Array  # see evoros.geometry.grid
    starts: Array  # index of the first entry of each grid cell
    entries: Array  # rows of ``fixed`` within reach of bodies in a cell
    fixed: Matrix  # (f, FIXED_SIZE), immovable obstacles
    fixed_corners: Matrix  # (c, 2) [m], corners of ``fixed``
    walk: Array = NO_VALUES  # a packed Walk


class Placed(NamedTuple):
    """The poses of bodies and walkers in a mission."""

    poses: Matrix  # (b, POSE_SIZE)
    saved: Matrix  # (b, POSE_SIZE), poses before the step
    levels: Array  # (b,) rank in the chain of pushed bodies, 1 next to the robot, 0 if not pushed
    corners: Matrix  # (c, 2) [m], corners of the parts in the world
    sights: Matrix  # (s, OBSTACLE_SIZE), parts and walkers for ray casting in the world
    robots: Matrix  # (r, 4), poses of robots to which walkers react
    walking: Array = NO_VALUES  # a packed Walking


@lru_cache(maxsize=KEPT_WORLDS)
def can_push(world: World) -> bool:
    """Return True if a world has movable bodies and its missions continue after a contact."""
    movable = any(body.mass is not None for body in world.obstacles)
    return movable and not world.course.end_on_collision


@lru_cache(maxsize=64)
def find_movables(world: World, tallest: float) -> tuple[tuple[Body, ...], Movables]:
    """Return the immovable obstacles, and the bodies that robots up to ``tallest`` can push."""
    fixed, pushable = split_obstacles(world, tallest) if can_push(world) else ((), ())
    if not pushable:
        nothing = np.zeros((0, BODY_SIZE)), np.zeros((0, PART_SIZE)), np.zeros((0, 2))
        sights = np.zeros((0, OBSTACLE_SIZE)), np.zeros((0, FACE_SIZE))
        still = np.zeros(0), np.zeros(0), np.zeros((0, FIXED_SIZE)), np.zeros((0, 2))
        return standing_obstacles(world), Movables(*nothing, *sights, np.zeros(GRID_SIZE), *still)
    reach = max(body.radius for body in pushable)
    return fixed, Movables(*_lay_out_bodies(pushable), *_lay_out_fixed(fixed, reach))


def _lay_out_bodies(pushable: Sequence[Pushable]) -> tuple[Array, ...]:
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
    solids = [solid for body in fixed for solid in body.placed if solid[0].kind != "plane"]
    areas = [footprint.project_shape(shape, pose) for shape, pose in solids]
    heights = [footprint.find_heights(shape, pose) for shape, pose in solids]
    grid, outlines = Grid.around(areas, reach), footprint.Outlines.of(areas)
    rows = np.concatenate([outlines.rows, np.array(heights).reshape(-1, 2)], axis=1)
    return grid.to_array(), *grid.list_near(areas, reach), rows, outlines.corners


def place_bodies(movables: Movables) -> Placed:
    """Return the bodies at their initial poses."""
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
    """Move the corners and ray shapes of a body to its current pose."""
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
