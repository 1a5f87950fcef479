"""The arrays of the planar simulator: a robot in a world as parameters, and a mission's memory.

``parameters`` holds the numbers named first below, then the start of each block, then the blocks.
"""

import math

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import STATE_SIZE, YAW, Array, X, Y
from evoros.base.compilable import compilable
from evoros.drive.protocol import Drive
from evoros.robot.model import Robot
from evoros.robot.rays import DIRECTION
from evoros.simulator.engines.planar_beams import FREE_RANGE, beam_rows, group_rows
from evoros.simulator.engines.planar_bodies import lay_out_pushing, start_memory, surround
from evoros.simulator.engines.rays import sensor_beams
from evoros.simulator.engines.steered_sight import lay_out_steered_sight
from evoros.world.model import World

# The numbers at the front of the parameters.
(
    TIME_STEP,  # [s]
    STEERING_GAIN,  # share of its error that the steering makes up in one step
    SPEED_GAIN,  # share of its error that the speed makes up in one step
    MAX_SPEED,  # [m/s]
    SPEED_LIMIT_OFFSET,  # [m] beside the rear axle's centre, where the speed has its limit
    STEERING_LIMIT,  # [rad]
    WHEELBASE,  # [m]
    REAR_AXLE_X,  # [m]
    OUTLINE_RADIUS,  # [m] from the origin to the farthest corner of the outline
    STARTS,  # the start of each block, and the end of the last
) = range(10)

# The blocks, in the order of ``obstacle_arrays`` from the grid to the faces.
(
    OUTLINE,  # (k, 2) corners [m]
    BEAMS,  # (n, BEAM_SIZE)
    GROUPS,  # (g, GROUP_SIZE)
    RAYS,  # (m, 3) unit vectors, in the robot's frame
    GRID,  # as in evoros.geometry.grid
    CONTACT_STARTS,  # by cell, its first of CONTACT_ENTRIES
    CONTACT_ENTRIES,  # rows of FOOTPRINTS within reach of the outline
    VISIBLE_STARTS,  # by cell, its first of VISIBLE_ENTRIES
    VISIBLE_ENTRIES,  # rows of OBSTACLES within reach of the sensors
    FOOTPRINTS,  # as in evoros.geometry.outlines
    CORNERS,  # (c, 2) [m], of the footprints
    OBSTACLES,  # as in evoros.geometry.ray
    FACES,  # of polyhedra, as in evoros.geometry.ray
    PROBES,  # (p, PROBE_SIZE), as in planar_signals
    PUSHING,  # as in planar_bodies; empty if nothing can be pushed
    STEERED,  # as in steered_sight; empty if no sensor can see a steered wheel
) = range(16)
BLOCKS = 16
HEADER_SIZE = STARTS + BLOCKS + 1

# The memory: the state, then these.
STEERING_ANGLE = STATE_SIZE  # [rad]
ROLLED, TURNED = STATE_SIZE + 1, STATE_SIZE + 2  # by the rear axle since the start [m], [rad]
PLACED_OUTLINE = STATE_SIZE + 3  # (k, 2) corners [m] where the robot would be after the next step
"""After it come the touches of each probe, and the bodies that can be pushed, as in
planar_bodies."""
PROBE_SIZE = 10


@compilable
def block(parameters: Array, number: int) -> Array:
    """One of the blocks, flat."""
    return parameters[int(parameters[STARTS + number]) : int(parameters[STARTS + number + 1])]


def lay_out(
    robot: Robot,
    world: World,
    time_step: float,
    steering_lag: float,
    drive_lag: float,
    probes: Array,
    tallest: float,
) -> Array:
    """The parameters of ``planar_rules`` for a robot in a world.

    The times are in [s]; ``probes`` is a block; ``tallest`` is the height [m] of the tallest robot.
    """
    frames = robot.sensor_frames
    beams = sensor_beams(robot)
    rays = robot.ray_table.rows[:, DIRECTION : DIRECTION + 3]
    rows = beam_rows(robot, frames, beams, rays)
    radius = float(np.sqrt((robot.outline * robot.outline).sum(axis=1)).max())
    sight = measure_sight(rows)
    surroundings, bodies = surround(world, robot.height_m, radius, sight, tallest)
    groups, pushing = group_rows(robot, rows, rays), lay_out_pushing(robot, bodies)
    clear_ranges = np.array([beam.clear_range for beam in beams])
    steered = lay_out_steered_sight(robot, clear_ranges)
    blocks = [robot.outline, rows, groups, rays, *surroundings, probes, pushing, steered]
    starts = HEADER_SIZE + np.cumsum([0, *(array.size for array in blocks)])
    numbers = [
        time_step,
        _gain(time_step, steering_lag if robot.drive.steering_joints else 0.0),
        _gain(time_step, drive_lag),
        *_limits(robot.drive),
        radius,
    ]
    return np.concatenate([numbers, starts, *(array.ravel() for array in blocks)])


def lay_out_memory(parameters: Array, home: tuple[float, float, float]) -> Array:
    """The memory of a mission that starts at x, y [m] and yaw [rad]."""
    probes = len(block(parameters, PROBES)) // PROBE_SIZE
    memory = np.zeros(PLACED_OUTLINE + len(block(parameters, OUTLINE)) + probes)
    memory[[X, Y, YAW]] = home
    return np.concatenate([memory, start_memory(block(parameters, PUSHING))])


def _limits(drive: Drive) -> tuple[float, ...]:
    return (
        drive.max_speed_mps,
        drive.speed_limit_offset_m,
        drive.steering_limit,
        drive.wheelbase_m / drive.turn_ratio,
        drive.rear_axle_x_m,
    )


def _gain(step: float, lag: float) -> float:
    """Share of an error that a first-order lag with this time constant makes up in one step."""
    return -elementary.expm1(-step / lag) if lag > 0.0 else 1.0


def measure_sight(beams: Array) -> float:
    """How far [m] the sensors see from the robot's origin.

    Rounded up to half metres, so that many designs share the arrays of a world.
    """
    if not len(beams):
        return 0.5
    farthest = (np.sqrt((beams[:, :2] * beams[:, :2]).sum(axis=1)) + beams[:, FREE_RANGE]).max()
    return math.ceil(2.0 * float(farthest)) / 2
