"""What the planar simulator keeps of a robot in a world, in one array: where is what."""

import math

import numpy as np

from evoros.base.arrays import Array
from evoros.drive.protocol import Drive
from evoros.robot.model import Robot
from evoros.world.model import World
from evoros.world.obstacles import world_arrays

# The parameters: these numbers, then the arrays, each of which starts where ``BEGINS`` says.
(
    STEP,  # [s]
    STEERING_SHARE,  # of its error, that the steering makes up in one step
    DRIVE_SHARE,
    FASTEST,  # [m/s]
    LIMITED_AT,  # [m] beside the turning point, where the speed has its limit
    LOCK,  # [rad]
    WHEELBASE,  # [m]
    AXLE,  # x of the turning point [m]
    REACH,  # of the outline from the origin [m]
    BEGINS,
) = range(10)
(
    OUTLINE,  # (k, 2) corners [m]
    SENSORS,  # (n, SENSOR_SIZE)
    RAYS,  # (m, 3) unit vectors, in the robot's frame
    GRID,
    TOUCHED_FROM,  # by cell, the first of TOUCHED
    TOUCHED,  # rows of FOOTPRINTS within reach of the outline
    SEEN_FROM,
    SEEN,  # rows of OBSTACLES within reach of the sensors
    FOOTPRINTS,
    CORNERS,  # (c, 2) [m], of the footprints
    OBSTACLES,  # as plane.ray has them
) = range(11)
ARRAYS = 11
HEAD = BEGINS + ARRAYS + 1

# A sensor: where it is [m], least range, range of the ground it sees, or its greatest [m], its
# rays, and the unit vectors across the left and right edges of its beam, outwards; 0: no edge.
AT, LEAST, FREE, FIRST_RAY, BEHIND_RAYS, LEFT, RIGHT = 0, 3, 4, 5, 6, 7, 9
SENSOR_SIZE = 11


def parameters_of(
    robot: Robot, world: World, step: float, steering_lag: float, drive_lag: float
) -> Array:
    """The parameters of the rules of ``simulator.planar``; the arguments are in seconds."""
    sensors, rays = _sensors(robot)
    reach = float(np.sqrt((robot.outline * robot.outline).sum(axis=1)).max())
    there = world_arrays(world, robot.height_m, reach, _farthest(sensors))
    arrays = [robot.outline, sensors, rays, *there]
    ends = HEAD + np.cumsum([0, *(array.size for array in arrays)])
    lagging = bool(robot.drive.steering_joints)
    head = [
        step,
        _share(step, steering_lag if lagging else 0.0),
        _share(step, drive_lag),
        *_limits(robot.drive),
        reach,
    ]
    return np.concatenate([head, ends, *(array.ravel() for array in arrays)])


def _limits(drive: Drive) -> tuple[float, ...]:
    return (
        drive.max_speed_mps,
        drive.speed_limit_offset_m,
        drive.steering_limit,
        drive.wheelbase_m,
        drive.rear_axle_x_m,
    )


def _share(step: float, lag: float) -> float:
    """Of an error, that a first-order lag makes up in one step."""
    return -math.expm1(-step / lag) if lag > 0.0 else 1.0


def _farthest(sensors: Array) -> float:
    """How far [m] the sensors see from the origin, in half metres: designs share their scene."""
    if not len(sensors):
        return 0.5
    return (
        math.ceil(2.0 * float((np.hypot(sensors[:, 0], sensors[:, 1]) + sensors[:, FREE]).max()))
        / 2
    )


def _sensors(robot: Robot) -> tuple[Array, Array]:
    """The rows of the sensors and their rays, in the frame of the robot."""
    sensors, rays, first = np.zeros((len(robot.mounts), SENSOR_SIZE)), [np.zeros((0, 3))], 0
    beams = {name: sensor.rays() for name, sensor in robot.sensors.items()}
    for row, mount, frame in zip(sensors, robot.mounts, robot.sensor_frames(), strict=True):
        sensor = robot.sensors[mount.sensor]
        beam = beams[mount.sensor] @ frame[:3, :3].T
        row[AT : AT + 3] = frame[:3, 3]
        row[LEAST] = sensor.range_min_m
        row[FREE] = _ground(beam, float(frame[2, 3]), sensor.range_max_m)
        row[FIRST_RAY], row[BEHIND_RAYS] = first, first + len(beam)
        row[LEFT : LEFT + 4] = _edges(beam, math.atan2(frame[1, 0], frame[0, 0]))
        rays.append(beam)
        first += len(beam)
    return sensors, np.concatenate(rays)


def _ground(beam: Array, height: float, farthest: float) -> float:
    """The range [m] of the nearest ground: always the same, for the robot stays level."""
    steepest = float(beam[:, 2].min())
    return height / -steepest if -steepest * farthest > height else farthest


def _edges(beam: Array, yaw: float) -> tuple[float, float, float, float]:
    """Across the beam's left and right edge, outwards; zeros where it is not a wedge."""
    turned = np.arctan2(beam[:, 1], beam[:, 0]) - yaw
    turned = np.arctan2(np.sin(turned), np.cos(turned))
    if np.hypot(beam[:, 0], beam[:, 1]).min() < 1e-6 or np.abs(turned).max() >= math.pi / 2:
        return 0.0, 0.0, 0.0, 0.0
    left, right = yaw + float(turned.max()), yaw + float(turned.min())
    return -math.sin(left), math.cos(left), math.sin(right), -math.cos(right)
