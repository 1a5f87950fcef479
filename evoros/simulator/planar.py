"""A robot on wheels on flat ground, thousands of times faster than real time.

The robot's turning point rolls along arcs without slip (the bicycle model); its outline stops at
obstacles, none of which moves; its sensors send the same rays into the same world as those of a
rigid-body engine. ``docs/fidelity.md`` shows how far the two agree.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from evoros.compiled import compilable
from evoros.drive.protocol import Drive
from evoros.errors import NOT_NEGATIVE, POSITIVE, check
from evoros.plane.index import GRID_SIZE, cell_at
from evoros.plane.polygon import gap, place
from evoros.plane.ray import AT_X, AT_Y, AT_Z, BOUND, OBSTACLE_SIZE, first_hit
from evoros.plane.scene import (
    BEHIND,
    CENTRE_X,
    CENTRE_Y,
    CIRCLE,
    FIRST,
    FOOTPRINT_SIZE,
    ROUND,
    scene,
)
from evoros.robot import Robot
from evoros.types import (
    CONTACT,
    DRIVE_SPEED,
    SPEED,
    STATE_SIZE,
    STEERING,
    YAW,
    YAW_RATE,
    Array,
    Motion,
    RuleSimulation,
    X,
    Y,
)
from evoros.world import World

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

TURN = 2.0 * math.pi

# The memory: the state, the steering angle [rad], and the outline where it would be next.
WHEEL = STATE_SIZE
PLACED = STATE_SIZE + 1


@dataclass(frozen=True)
class Planar:
    """Wheels that roll without slip, servos that lag, an outline that stops at obstacles.

    Raises:
        InputError: a value out of range.
    """

    time_step: float = 0.02  # [s]
    steering_lag_s: float = 0.025  # time constant with which the curvature follows the command
    drive_lag_s: float = 0.0  # time constant of the speed

    def __post_init__(self) -> None:
        check(
            self,
            time_step=POSITIVE,
            steering_lag_s=NOT_NEGATIVE,
            drive_lag_s=NOT_NEGATIVE,
        )

    @property
    def rules(self) -> Motion:
        """How a mission is observed, sensed and driven."""
        return Motion(observe, sense, advance)

    @contextmanager
    def open(self, robot: Robot, world: World) -> Iterator[RuleSimulation]:
        """The robot at the world's home, at rest."""
        home_x, home_y, _, home_yaw = world.course.home
        memory = np.zeros(PLACED + robot.outline.size)
        memory[[X, Y, YAW]] = home_x, home_y, home_yaw
        yield RuleSimulation(self.rules, self._parameters(robot, world), memory)

    def _parameters(self, robot: Robot, world: World) -> Array:
        sensors, rays = _sensors(robot)
        reach = float(np.sqrt((robot.outline * robot.outline).sum(axis=1)).max())
        there = scene(world, robot.height_m, reach, _farthest(sensors))
        arrays = [robot.outline, sensors, rays, *there]
        ends = HEAD + np.cumsum([0, *(array.size for array in arrays)])
        lagging = bool(robot.drive.steering_joints)
        head = [
            self.time_step,
            _share(self.time_step, self.steering_lag_s if lagging else 0.0),
            _share(self.time_step, self.drive_lag_s),
            *_limits(robot.drive),
            reach,
        ]
        return np.concatenate([head, ends, *(array.ravel() for array in arrays)])


def _limits(drive: Drive) -> tuple[float, ...]:
    return (
        drive.max_speed_mps,
        drive.limited_at_m,
        drive.steering_limit,
        drive.wheelbase_m,
        drive.turning_x_m,
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
    falling = beam[beam[:, 2] < 0.0, 2]
    return min(farthest, float((-height / falling).min())) if len(falling) else farthest


def _edges(beam: Array, yaw: float) -> tuple[float, float, float, float]:
    """Across the beam's left and right edge, outwards; zeros where it is not a wedge."""
    turned = np.arctan2(beam[:, 1], beam[:, 0]) - yaw
    turned = np.arctan2(np.sin(turned), np.cos(turned))
    if np.hypot(beam[:, 0], beam[:, 1]).min() < 1e-6 or np.abs(turned).max() >= math.pi / 2:
        return 0.0, 0.0, 0.0, 0.0
    left, right = yaw + float(turned.max()), yaw + float(turned.min())
    return -math.sin(left), math.cos(left), math.sin(right), -math.cos(right)


def observe(parameters: Array, memory: Array, state: Array) -> None:
    """The state; contact with an obstacle since the last call."""
    for i in range(STATE_SIZE):
        state[i] = memory[i]
    memory[CONTACT] = 0.0


def sense(parameters: Array, memory: Array, readings: Array) -> None:
    """The nearest hit of each sensor's rays [m], within the sensor's range."""
    at = parameters[BEGINS:]
    sensors = parameters[int(at[SENSORS]) : int(at[RAYS])].reshape((-1, SENSOR_SIZE))
    for i in range(len(readings)):
        readings[i] = sensors[i, FREE]
    grid = parameters[int(at[GRID]) : int(at[GRID]) + GRID_SIZE]
    x = memory[X]
    y = memory[Y]
    cell = cell_at(grid, x, y)
    if cell >= 0:
        rays = parameters[int(at[RAYS]) : int(at[GRID])].reshape((-1, 3))
        starts = parameters[int(at[SEEN_FROM]) : int(at[SEEN])]
        entries = parameters[int(at[SEEN]) : int(at[FOOTPRINTS])]
        obstacles = parameters[int(at[OBSTACLES]) :].reshape((-1, OBSTACLE_SIZE))
        cos = math.cos(memory[YAW])
        sin = math.sin(memory[YAW])
        for entry in range(int(starts[cell]), int(starts[cell + 1])):
            obstacle = obstacles[int(entries[entry])]
            dx = obstacle[AT_X] - x
            dy = obstacle[AT_Y] - y
            ahead = cos * dx + sin * dy
            aside = cos * dy - sin * dx
            bound = obstacle[BOUND]
            for i in range(len(readings)):
                px = ahead - sensors[i, AT]
                py = aside - sensors[i, AT + 1]
                far = readings[i] + bound
                if px * px + py * py >= far * far:
                    continue
                if px * sensors[i, LEFT] + py * sensors[i, LEFT + 1] > bound:
                    continue
                if px * sensors[i, RIGHT] + py * sensors[i, RIGHT + 1] > bound:
                    continue
                pz = obstacle[AT_Z] - sensors[i, AT + 2]
                first = int(sensors[i, FIRST_RAY])
                behind = int(sensors[i, BEHIND_RAYS])
                readings[i] = first_hit(
                    obstacle, cos, sin, -px, -py, -pz, rays, first, behind, readings[i]
                )
    for i in range(len(readings)):
        if readings[i] < sensors[i, LEAST]:
            readings[i] = sensors[i, LEAST]


def advance(parameters: Array, memory: Array, command: Array, duration: float) -> None:
    """Drive for some steps; a step into an obstacle is not made, and the robot stands."""
    axle = parameters[AXLE]
    lock = parameters[LOCK]
    step = parameters[STEP]
    wanted = min(max(command[STEERING], -lock), lock)
    yaw = memory[YAW]
    cos = math.cos(yaw)
    sin = math.sin(yaw)
    for _ in range(round(duration / step)):
        memory[WHEEL] += parameters[STEERING_SHARE] * (wanted - memory[WHEEL])
        curvature = math.tan(memory[WHEEL]) / parameters[WHEELBASE]
        fastest = parameters[FASTEST] / (1.0 + abs(curvature) * parameters[LIMITED_AT])
        target = min(max(command[DRIVE_SPEED], -fastest), fastest)
        memory[SPEED] += parameters[DRIVE_SHARE] * (target - memory[SPEED])
        memory[YAW_RATE] = memory[SPEED] * curvature
        # The turning point runs along an arc, whose chord lies half the turn to the side.
        half = 0.5 * memory[YAW_RATE] * step
        chord = memory[SPEED] * step
        if abs(half) > 1e-6:
            chord = chord * math.sin(half) / half
        x = memory[X] + axle * cos + chord * math.cos(yaw + half)
        y = memory[Y] + axle * sin + chord * math.sin(yaw + half)
        turned = yaw + 2.0 * half
        if turned > math.pi:
            turned -= TURN
        elif turned < -math.pi:
            turned += TURN
        new_cos = math.cos(turned)
        new_sin = math.sin(turned)
        x -= axle * new_cos
        y -= axle * new_sin
        if touches(parameters, memory, x, y, new_cos, new_sin):
            memory[CONTACT] = 1.0
            memory[SPEED] = 0.0
            memory[YAW_RATE] = 0.0
            continue
        yaw = turned
        cos = new_cos
        sin = new_sin
        memory[X] = x
        memory[Y] = y
        memory[YAW] = yaw


@compilable
def touches(parameters: Array, memory: Array, x: float, y: float, cos: float, sin: float) -> bool:
    """Whether the outline of the robot, at x, y [m] and a heading, meets an obstacle."""
    at = parameters[BEGINS:]
    cell = cell_at(parameters[int(at[GRID]) : int(at[GRID]) + GRID_SIZE], x, y)
    if cell < 0:
        return False
    first = int(parameters[int(at[TOUCHED_FROM]) + cell])
    behind = int(parameters[int(at[TOUCHED_FROM]) + cell + 1])
    if first == behind:
        return False
    outline = parameters[int(at[OUTLINE]) : int(at[SENSORS])].reshape((-1, 2))
    placed = memory[PLACED:].reshape((-1, 2))
    place(outline, x, y, cos, sin, placed)
    entries = parameters[int(at[TOUCHED]) : int(at[SEEN_FROM])]
    footprints = parameters[int(at[FOOTPRINTS]) : int(at[CORNERS])].reshape((-1, FOOTPRINT_SIZE))
    corners = parameters[int(at[CORNERS]) : int(at[OBSTACLES])].reshape((-1, 2))
    for entry in range(first, behind):
        row = footprints[int(entries[entry])]
        dx = row[CENTRE_X] - x
        dy = row[CENTRE_Y] - y
        near = parameters[REACH] + row[CIRCLE]
        if dx * dx + dy * dy > near * near:
            continue
        other = corners[int(row[FIRST]) : int(row[BEHIND])]
        if gap(placed, other, row[ROUND]) <= row[ROUND]:
            return True
    return False
