"""The arrays of the bodies that robots push in the plane: parameters, and a mission's memory.

The parameters are one block of those of ``planar_layout``, with a header and blocks of its own. The
block is empty if nothing can be pushed.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from evoros.base.arrays import Array
from evoros.base.compilable import compilable
from evoros.geometry.footprint import bottom_height, project_shape, top_height
from evoros.geometry.grid import Grid
from evoros.geometry.outlines import Outlines
from evoros.geometry.polygon import transform_polygon
from evoros.geometry.ray import OBSTACLE_SIZE, place_obstacle
from evoros.geometry.shapes import Body, Pose
from evoros.robot.model import Robot
from evoros.world.model import World
from evoros.world.movable import Pushable, split_obstacles
from evoros.world.obstacles import obstacle_arrays, sight_rows, world_arrays

# The numbers at the front of the block.
GRIP, HEIGHT, BLOCK_STARTS = range(3)
"""The mass [kg] whose friction of coefficient 1 the robot can overcome, its own; its height [m];
the start of each block, and the end of the last."""

(
    BODIES,  # (b, BODY_SIZE)
    PARTS,  # (s, PART_SIZE), the shapes of the bodies
    CORNERS,  # (c, 2) [m] from the centre of mass of their body, of the parts
    SIGHTS,  # (s, OBSTACLE_SIZE), of the parts, from the centre of mass of their body
    FACES,  # of polyhedra, as in evoros.geometry.ray
    NEAR_STARTS,  # by cell of the grid, its first of NEAR_ENTRIES
    NEAR_ENTRIES,  # rows of FIXED within reach of the bodies
    FIXED,  # (f, FIXED_SIZE), the obstacles that stay
    FIXED_CORNERS,  # (c, 2) [m], of FIXED
) = range(9)
BLOCKS = 9
HEADER_SIZE = BLOCK_STARTS + BLOCKS + 1

START_X, START_Y, BODY_RADIUS, ARM_SQUARED, FRICTION, LOAD, FIRST_PART, END_PART = range(8)
"""A body: where its centre of mass is at first [m]; its radius [m] about that; the square of the
arm [m2] of its friction about the vertical; its coefficient of friction; that times its mass [kg];
its first part and the one after its last."""
BODY_SIZE = 8
RADIUS, START, END, BOTTOM, TOP = range(5)
"""A part: what surrounds its corners [m], its first corner and the one after its last, and its
lowest and highest point [m]."""
PART_SIZE = 5
CENTRE_X, CENTRE_Y, CIRCLE, FIXED_RADIUS, FIXED_START, FIXED_END, FIXED_BOTTOM, FIXED_TOP = range(8)
"""A fixed shape: a footprint as in ``evoros.geometry.outlines``, its lowest and highest point."""
FIXED_SIZE = 8

# The memory of a body: centre of mass [m], and cosine and sine of its turn since the start.
BODY_X, BODY_Y, BODY_COS, BODY_SIN = range(4)
POSE_SIZE = 4

MAX_FRICTION = 1.0  # as in PyBullet, whose chassis has friction 1


@compilable
def part_of(pushing: Array, number: int) -> Array:
    """One of the blocks, flat."""
    start = int(pushing[BLOCK_STARTS + number])
    return pushing[start : int(pushing[BLOCK_STARTS + number + 1])]


@lru_cache(maxsize=64)
def can_push(world: World) -> bool:
    """Whether missions in a world go on after contact, and it has bodies that can be moved."""
    movable = any(body.mass is not None for body in world.obstacles)
    return movable and not world.course.end_on_collision


def surround(
    world: World, height: float, touch: float, see: float, tallest: float
) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    """Return the obstacles that stay, as ``obstacle_arrays``, and the blocks for those that move.

    Nothing moves in a world whose missions end at the first contact. Robots share the bodies, which
    are those that one of the ``tallest`` height [m] can push.
    """
    if not can_push(world):
        return world_arrays(world, height, touch, see), ()
    fixed, pushable = split_obstacles(world, tallest)
    if not pushable:
        return world_arrays(world, height, touch, see), ()
    reach = max(body.radius for body in pushable)
    arrays = obstacle_arrays(fixed, height, touch, see, reach)
    return arrays, (*_lay_out_bodies(pushable), *_lay_out_fixed(fixed, arrays[0], reach))


def _lay_out_bodies(pushable: Sequence[Pushable]) -> tuple[Array, ...]:
    """Return the blocks from BODIES to FACES."""
    bodies, parts, corners, solids, first, count = [], [], [], [], 0, 0
    for body, own, radius, arm in pushable:
        x, y, _ = body.pose.position
        friction = min(body.friction, MAX_FRICTION)
        load = friction * (body.mass or 0.0)
        bodies.append([x, y, radius, arm * arm, friction, load, first, first + len(own)])
        first += len(own)
        for part in own:
            end = count + len(part.area.vertices)
            parts.append([part.area.radius, count, end, part.bottom, part.top])
            corners.append(part.area.vertices - (x, y))
            solids.append((part.shape, Pose((-x, -y, 0.0)) @ part.pose))
            count = end
    sights, faces, _ = sight_rows(solids)
    return np.array(bodies), np.array(parts), np.concatenate(corners), sights, faces


def _lay_out_fixed(fixed: Sequence[Body], grid: Array, reach: float) -> tuple[Array, ...]:
    """Return the blocks from NEAR_STARTS to FIXED_CORNERS."""
    solids = [(s, body.pose @ s.pose) for body in fixed for s in body.shapes if s.kind != "plane"]
    areas = [project_shape(shape, pose) for shape, pose in solids]
    heights = [(bottom_height(shape, pose), top_height(shape, pose)) for shape, pose in solids]
    cells = Grid(grid[:2], float(grid[2]), (int(grid[3]), int(grid[4])))
    outlines = Outlines.of(areas)
    rows = np.concatenate([outlines.rows, np.array(heights).reshape(-1, 2)], axis=1)
    return (*cells.list_near(areas, reach), rows, outlines.corners)


def lay_out_pushing(robot: Robot, blocks: tuple[Array, ...]) -> Array:
    """Return the block of ``planar_layout`` for a robot."""
    if not blocks:
        return np.zeros(0)
    starts = HEADER_SIZE + np.cumsum([0, *(array.size for array in blocks)])
    numbers = [_weigh(robot), robot.height_m]
    return np.concatenate([numbers, starts, *(array.ravel() for array in blocks)])


def _weigh(robot: Robot) -> float:
    """Return the mass [kg] of a robot with its sensors."""
    masses = robot.urdf_elements().iterfind("link/inertial/mass")
    return sum(float(mass.get("value", "0")) for mass in masses)


def start_memory(pushing: Array) -> Array:
    """Return the memory of the bodies where they stand at first, for ``memory_views``."""
    if not len(pushing):
        return np.zeros(0)
    bodies = part_of(pushing, BODIES).reshape(-1, BODY_SIZE)
    count = len(bodies)
    size = 2 * POSE_SIZE * count + count
    size += sum(len(part_of(pushing, number)) for number in (CORNERS, SIGHTS))
    memory = np.zeros(size)
    poses, *_ = memory_views(pushing, memory)
    poses[:, [BODY_X, BODY_Y]] = bodies[:, [START_X, START_Y]]
    poses[:, BODY_COS] = 1.0
    for number in range(count):
        place_body(pushing, memory, number)
    return memory


@compilable
def memory_views(pushing: Array, memory: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Return the parts of the memory of bodies.

    They are the poses (b, POSE_SIZE), those before the step, how far from the robot each body is in
    the chain of those that push each other in this step (b,), and where the corners (c, 2) and the
    shapes for rays (s, OBSTACLE_SIZE) of all parts are.
    """
    count = len(part_of(pushing, BODIES)) // BODY_SIZE
    corners = len(part_of(pushing, CORNERS))
    a = POSE_SIZE * count
    c = 2 * a + count
    return (
        memory[:a].reshape((-1, POSE_SIZE)),
        memory[a : 2 * a].reshape((-1, POSE_SIZE)),
        memory[2 * a : c],
        memory[c : c + corners].reshape((-1, 2)),
        memory[c + corners :].reshape((-1, OBSTACLE_SIZE)),
    )


@compilable
def place_body(pushing: Array, memory: Array, number: int) -> None:
    """Move the corners and the shapes for rays of a body to its pose."""
    poses, _, _, corners, sights = memory_views(pushing, memory)
    body = part_of(pushing, BODIES).reshape((-1, BODY_SIZE))[number]
    parts = part_of(pushing, PARTS).reshape((-1, PART_SIZE))
    local = part_of(pushing, CORNERS).reshape((-1, 2))
    solids = part_of(pushing, SIGHTS).reshape((-1, OBSTACLE_SIZE))
    x = poses[number, BODY_X]
    y = poses[number, BODY_Y]
    cos = poses[number, BODY_COS]
    sin = poses[number, BODY_SIN]
    for part in range(int(body[FIRST_PART]), int(body[END_PART])):
        start = int(parts[part, START])
        end = int(parts[part, END])
        transform_polygon(local[start:end], x, y, cos, sin, corners[start:end])
        place_obstacle(solids[part], x, y, cos, sin, sights[part])
