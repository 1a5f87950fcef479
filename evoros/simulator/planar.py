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

from evoros.base.arrays import (
    CONTACT,
    DRIVE_SPEED,
    SPEED,
    STATE_SIZE,
    STEERING,
    YAW,
    YAW_RATE,
    Array,
    X,
    Y,
)
from evoros.base.checks import NOT_NEGATIVE, Rule, check, is_number
from evoros.base.compilation import compilable
from evoros.geometry.grid import GRID_SIZE, cell_at
from evoros.geometry.outlines import (
    BEHIND,
    CENTRE_X,
    CENTRE_Y,
    CIRCLE,
    FIRST,
    FOOTPRINT_SIZE,
    ROUND,
)
from evoros.geometry.polygon import gap, place
from evoros.geometry.ray import AT_X, AT_Y, AT_Z, BOUND, OBSTACLE_SIZE, first_hit
from evoros.robot.model import Robot
from evoros.simulator.engines.planar_layout import (
    AT,
    AXLE,
    BEGINS,
    BEHIND_RAYS,
    CORNERS,
    DRIVE_SHARE,
    FASTEST,
    FIRST_RAY,
    FOOTPRINTS,
    FREE,
    GRID,
    LEAST,
    LEFT,
    LIMITED_AT,
    LOCK,
    OBSTACLES,
    OUTLINE,
    RAYS,
    REACH,
    RIGHT,
    SEEN,
    SEEN_FROM,
    SENSOR_SIZE,
    SENSORS,
    STEERING_SHARE,
    STEP,
    TOUCHED,
    TOUCHED_FROM,
    WHEELBASE,
    parameters_of,
)
from evoros.simulator.protocol import Motion, RuleSimulation
from evoros.world.model import World

TURN = 2.0 * math.pi

LARGEST_STEP = 0.1  # [s]
"""Contact is looked for after each step: a thin wall must not be stepped over."""
STEP_S = Rule(
    f"a number greater than 0 and at most {LARGEST_STEP}",
    lambda v: is_number(v) and 0 < v <= LARGEST_STEP,
)

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
    steering_lag_s: float = 0.05  # time constant of the steering servos
    drive_lag_s: float = 0.0  # time constant of the speed

    def __post_init__(self) -> None:
        check(
            self,
            time_step=STEP_S,
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
        lags = self.steering_lag_s, self.drive_lag_s
        parameters = parameters_of(robot, world, self.time_step, *lags)
        yield RuleSimulation(self.rules, parameters, memory)


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
            look(obstacle, x, y, cos, sin, sensors, rays, readings)
    for i in range(len(readings)):
        if readings[i] < sensors[i, LEAST]:
            readings[i] = sensors[i, LEAST]


@compilable
def look(
    obstacle: Array,
    x: float,
    y: float,
    cos: float,
    sin: float,
    sensors: Array,
    rays: Array,
    readings: Array,
) -> None:
    """Lower the readings [m] of the sensors that see the obstacle nearer than they read."""
    dx = obstacle[AT_X] - x
    dy = obstacle[AT_Y] - y
    ahead = cos * dx + sin * dy
    aside = cos * dy - sin * dx
    bound = obstacle[BOUND]
    for i in range(len(readings)):
        px = ahead - sensors[i, AT]
        py = aside - sensors[i, AT + 1]
        # Too far, or beside the beam: then none of its rays needs to be looked at.
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
        readings[i] = first_hit(obstacle, cos, sin, -px, -py, -pz, rays, first, behind, readings[i])


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
