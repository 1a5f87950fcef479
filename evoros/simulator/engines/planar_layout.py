"""The arrays of the planar simulator: a robot in a world as parameters, and a mission's memory.

``parameters`` holds the numbers named first below, then the start of each block, then the blocks.
"""

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from evoros.base.arrays import STATE_SIZE, YAW, Array, X, Y
from evoros.base.compilation import compilable
from evoros.drive.protocol import Drive
from evoros.robot.model import Robot
from evoros.simulator.engines.planar_bodies import lay_out_pushing, start_memory, surround
from evoros.simulator.engines.rays import Beam, sensor_beams
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
    PUSHING,  # as in planar_bodies; empty if nothing can be pushed
) = range(13)
BLOCKS = 13
HEADER_SIZE = STARTS + BLOCKS + 1

# A beam, which is a channel of a sensor, is a row of the block BEAMS.
ORIGIN, MIN_RANGE, FREE_RANGE, FIRST_RAY, END_RAY, LEFT_EDGE, RIGHT_EDGE = 0, 3, 4, 5, 6, 7, 9
"""Origin (3,) [m]; minimum range [m]; reading without obstacles [m]; its first ray and the one
after its last; unit vectors (2,) outwards across the left and the right edge of its beam, or 0
without edges."""
BEAM_SIZE = 11

# The memory: the state, then these.
STEERING_ANGLE = STATE_SIZE  # [rad]
PLACED_OUTLINE = STATE_SIZE + 1  # (k, 2) corners [m] where the robot would be after the next step
"""After it come the bodies that can be pushed, as in planar_bodies."""


@compilable
def block(parameters: Array, number: int) -> Array:
    """One of the blocks, flat."""
    return parameters[int(parameters[STARTS + number]) : int(parameters[STARTS + number + 1])]


def lay_out(
    robot: Robot, world: World, time_step: float, steering_lag: float, drive_lag: float
) -> Array:
    """The parameters of ``planar_rules`` for a robot in a world; the last arguments are in [s]."""
    frames = robot.sensor_frames()
    beams = sensor_beams(robot, frames)
    rows = _beam_rows(beams, _facing(robot, frames, beams))
    rays = np.concatenate([np.zeros((0, 3)), *(beam.directions for beam in beams)])
    radius = float(np.sqrt((robot.outline * robot.outline).sum(axis=1)).max())
    surroundings, bodies = surround(world, robot.height_m, radius, _sight(rows))
    blocks = [robot.outline, rows, rays, *surroundings, lay_out_pushing(robot, bodies)]
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
    memory = np.zeros(PLACED_OUTLINE + len(block(parameters, OUTLINE)))
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
    return -math.expm1(-step / lag) if lag > 0.0 else 1.0


def _facing(robot: Robot, frames: Array, beams: Sequence[Beam]) -> Iterator[float]:
    """Yield the yaw [rad] of each beam: that of a sensor with one channel, or of the rays."""
    for part, frame in zip(robot.beam_layout, frames, strict=True):
        for beam in beams[part]:
            several = part.stop - part.start > 1
            x, y = beam.directions.mean(axis=0)[:2] if several else (frame[0, 0], frame[1, 0])
            yield math.atan2(y, x)


def _sight(beams: Array) -> float:
    """How far [m] the sensors see from the robot's origin.

    Rounded up to half metres, so that many designs share the arrays of a world.
    """
    if not len(beams):
        return 0.5
    farthest = (np.hypot(beams[:, 0], beams[:, 1]) + beams[:, FREE_RANGE]).max()
    return math.ceil(2.0 * float(farthest)) / 2


def _beam_rows(beams: Sequence[Beam], yaws: Iterable[float]) -> Array:
    """The block BEAMS; each beam spreads about its yaw [rad]."""
    rows, first = np.zeros((len(beams), BEAM_SIZE)), 0
    for row, beam, yaw in zip(rows, beams, yaws, strict=True):
        end = first + len(beam.directions)
        row[ORIGIN : ORIGIN + 3] = beam.origin
        row[MIN_RANGE] = beam.range_min
        row[FREE_RANGE] = _free_range(beam)
        row[FIRST_RAY], row[END_RAY] = first, end
        row[LEFT_EDGE : LEFT_EDGE + 4] = _edges(beam, yaw)
        first = end
    return rows


def _free_range(beam: Beam) -> float:
    """The reading [m] without obstacles: the ground, or the maximum range.

    It never changes, because the robot stays level.
    """
    height, slope = float(beam.origin[2]), float(beam.directions[:, 2].min())
    return height / -slope if -slope * beam.range_max > height else beam.range_max


def _edges(beam: Beam, yaw: float) -> tuple[float, float, float, float]:
    """Unit vectors outwards across the left and the right edge; zeros if it is not a wedge."""
    x, y = beam.directions[:, 0], beam.directions[:, 1]
    angles = np.arctan2(y, x) - yaw
    angles = np.arctan2(np.sin(angles), np.cos(angles))
    if np.hypot(x, y).min() < 1e-6 or np.abs(angles).max() >= math.pi / 2:
        return 0.0, 0.0, 0.0, 0.0
    left, right = yaw + float(angles.max()), yaw + float(angles.min())
    return -math.sin(left), math.cos(left), math.sin(right), -math.cos(right)
