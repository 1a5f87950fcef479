"""The rule by which sensors see in the planar simulator, over the arrays of ``planar_layout``.

It gives the same bits compiled and interpreted.
"""

import math

from evoros.base import elementary
from evoros.base.arrays import YAW, Array, X, Y
from evoros.base.compilable import compilable
from evoros.geometry.grid import cell_at
from evoros.geometry.ray import (
    AT_X,
    AT_Y,
    AT_Z,
    BOUND,
    BOX,
    FACE_SIZE,
    KIND,
    OBSTACLE_SIZE,
    cast_rays,
    is_beside,
    is_beyond,
    turn_frame,
)
from evoros.simulator.engines import planar_bodies as bodies
from evoros.simulator.engines import planar_layout as layout
from evoros.simulator.engines.planar_beams import (
    BEAM_SIZE,
    END_BEAM,
    END_RAY,
    FIRST_BEAM,
    FIRST_RAY,
    FREE_RANGE,
    GROUP_SIZE,
    LEFT_EDGE,
    MIN_RANGE,
    ORIGIN,
    REACH,
    RIGHT_EDGE,
    SPACING,
    find_span,
)
from evoros.simulator.engines.planar_bodies import memory_views, part_of
from evoros.simulator.engines.planar_layout import block
from evoros.simulator.engines.planar_signals import fill_signals
from evoros.simulator.engines.steered_sight import see_parts_at

FULL_TURN = 2.0 * math.pi


def sense(parameters: Array, memory: Array, ranges: Array) -> None:
    """Fill ``ranges`` (n,) with the nearest hit [m] of each beam, within the sensor's range."""
    sense_obstacles(parameters, memory, ranges)
    raise_to_minimum(parameters, ranges)


def sense_pushing(parameters: Array, memory: Array, ranges: Array) -> None:
    """Fill ``ranges`` as ``sense`` does, among bodies that can be pushed."""
    sense_obstacles(parameters, memory, ranges)
    sense_bodies(parameters, memory, ranges)
    raise_to_minimum(parameters, ranges)


def sense_signals(parameters: Array, memory: Array, signals: Array) -> None:
    """Fill ``signals`` with the ranges, as the other rules do, and with all other signals."""
    ranges = signals[: len(block(parameters, layout.BEAMS)) // BEAM_SIZE]
    sense_obstacles(parameters, memory, ranges)
    if len(block(parameters, layout.PUSHING)):
        sense_bodies(parameters, memory, ranges)
    raise_to_minimum(parameters, ranges)
    fill_signals(parameters, memory, signals)


@compilable
def sense_obstacles(parameters: Array, memory: Array, ranges: Array) -> None:
    """Fill ``ranges`` with the nearest hit [m] of each beam on the robot and on fixed obstacles."""
    beams = block(parameters, layout.BEAMS).reshape((-1, BEAM_SIZE))
    for i in range(len(ranges)):
        ranges[i] = beams[i, FREE_RANGE]
    steered = block(parameters, layout.STEERED)
    if len(steered) > 0:
        see_parts_at(steered, memory[layout.STEERING_ANGLE], ranges)
    x = memory[X]
    y = memory[Y]
    cell = cell_at(block(parameters, layout.GRID), x, y)
    if cell < 0:
        return
    groups = block(parameters, layout.GROUPS).reshape((-1, GROUP_SIZE))
    rays = block(parameters, layout.RAYS).reshape((-1, 3))
    starts = block(parameters, layout.VISIBLE_STARTS)
    entries = block(parameters, layout.VISIBLE_ENTRIES)
    obstacles = block(parameters, layout.OBSTACLES).reshape((-1, OBSTACLE_SIZE))
    faces = block(parameters, layout.FACES).reshape((-1, FACE_SIZE))
    sin, cos = elementary.sin_cos(memory[YAW])
    for entry in range(int(starts[cell]), int(starts[cell + 1])):
        obstacle = obstacles[int(entries[entry])]
        detect(obstacle, faces, x, y, cos, sin, groups, beams, rays, ranges)


@compilable
def raise_to_minimum(parameters: Array, ranges: Array) -> None:
    """Raise each range [m] to the minimum of its sensor."""
    beams = block(parameters, layout.BEAMS).reshape((-1, BEAM_SIZE))
    for i in range(len(ranges)):
        if ranges[i] < beams[i, MIN_RANGE]:
            ranges[i] = beams[i, MIN_RANGE]


@compilable
def sense_bodies(parameters: Array, memory: Array, ranges: Array) -> None:
    """Lower each range [m] whose beam sees a body that can be pushed at a shorter range."""
    pushing = block(parameters, layout.PUSHING)
    beams = block(parameters, layout.BEAMS).reshape((-1, BEAM_SIZE))
    rays = block(parameters, layout.RAYS).reshape((-1, 3))
    faces = part_of(pushing, bodies.FACES).reshape((-1, FACE_SIZE))
    _, _, _, _, sights = memory_views(pushing, memory[moving_memory(parameters) :])
    sin, cos = elementary.sin_cos(memory[YAW])
    groups = block(parameters, layout.GROUPS).reshape((-1, GROUP_SIZE))
    for i in range(len(sights)):
        detect(sights[i], faces, memory[X], memory[Y], cos, sin, groups, beams, rays, ranges)


@compilable
def moving_memory(parameters: Array) -> int:
    """Return where the memory of the bodies that can be pushed begins."""
    probes = len(block(parameters, layout.PROBES)) // layout.PROBE_SIZE
    return layout.PLACED_OUTLINE + len(block(parameters, layout.OUTLINE)) + probes


@compilable
def detect(
    obstacle: Array,
    faces: Array,
    x: float,
    y: float,
    cos: float,
    sin: float,
    groups: Array,
    beams: Array,
    rays: Array,
    ranges: Array,
) -> None:
    """Lower each range [m] whose beam sees the obstacle at a shorter range."""
    dx = obstacle[AT_X] - x
    dy = obstacle[AT_Y] - y
    ahead = cos * dx + sin * dy
    aside = cos * dy - sin * dx
    for g in range(len(groups)):
        if groups[g, SPACING] == 0.0:
            first = int(groups[g, FIRST_BEAM])
            end = int(groups[g, END_BEAM])
            cast_beams(obstacle, faces, cos, sin, ahead, aside, beams, rays, first, end, ranges)
            continue
        origin = beams[int(groups[g, FIRST_BEAM])]
        px = ahead - origin[ORIGIN]
        py = aside - origin[ORIGIN + 1]
        reach = groups[g, REACH] + obstacle[BOUND]
        if px * px + py * py >= reach * reach:
            continue
        pz = obstacle[AT_Z] - origin[ORIGIN + 2]
        ray = int(origin[FIRST_RAY])
        low, high = find_span(groups[g], px, py, obstacle[BOUND])
        first_beam = int(groups[g, FIRST_BEAM])
        count = int(groups[g, END_BEAM]) - first_beam
        turn = FULL_TURN / groups[g, SPACING]
        for k in range(-1, 2):
            start = max(int(low + k * turn), 0)
            end = min(int(high + k * turn) + 1, count)
            if start < end:
                cast_rays(
                    obstacle, faces, turn_frame(obstacle, cos, sin), -px, -py, -pz,
                    rays, ray + start, ray + end, math.inf, ranges, first_beam + start,
                )  # fmt: skip


@compilable
def cast_beams(
    obstacle: Array,
    faces: Array,
    cos: float,
    sin: float,
    ahead: float,
    aside: float,
    beams: Array,
    rays: Array,
    start: int,
    stop: int,
    ranges: Array,
) -> None:
    """Lower the ranges of the beams from ``start`` to before ``stop``, as ``detect`` does.

    (ahead, aside) [m] is the obstacle's centre in the robot's frame.
    """
    bound = obstacle[BOUND]
    for i in range(start, stop):
        px = ahead - beams[i, ORIGIN]
        py = aside - beams[i, ORIGIN + 1]
        # Skip the rays if the circle around the obstacle is too far away or beside the beam.
        far = ranges[i] + bound
        if px * px + py * py >= far * far:
            continue
        if px * beams[i, LEFT_EDGE] + py * beams[i, LEFT_EDGE + 1] > bound:
            continue
        if px * beams[i, RIGHT_EDGE] + py * beams[i, RIGHT_EDGE + 1] > bound:
            continue
        pz = obstacle[AT_Z] - beams[i, ORIGIN + 2]
        frame = turn_frame(obstacle, cos, sin)
        if obstacle[KIND] == BOX and (
            is_beside(obstacle, frame, px, py, beams[i, LEFT_EDGE], beams[i, LEFT_EDGE + 1])
            or is_beside(obstacle, frame, px, py, beams[i, RIGHT_EDGE], beams[i, RIGHT_EDGE + 1])
            or is_beyond(obstacle, frame, px, py, pz, ranges[i])
        ):
            continue
        first = int(beams[i, FIRST_RAY])
        end = int(beams[i, END_RAY])
        ranges[i] = cast_rays(
            obstacle, faces, frame, -px, -py, -pz, rays, first, end, ranges[i], ranges, -1
        )
