"""Drives a robot in an engine, on empty level ground, and compares its motion with the command."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evoros.base import elementary
from evoros.base.arrays import (
    COMMAND_SIZE,
    DRIVE_SPEED,
    STATE_SIZE,
    STEERING,
    YAW,
    Array,
    X,
    Y,
)
from evoros.filter.protocol import Filter
from evoros.robot.model import Robot
from evoros.robot.occlusion import Occluders
from evoros.sensor.protocol import RANGE, Channel, Mount
from evoros.simulator.protocol import Simulation, Simulator
from evoros.world.model import World

REST_S, PIECE_S, RUN_UP_PIECES, DRIVE_PIECES = 1.0, 0.25, 12, 8
SETTLED = 0.02  # change of the speed in a piece of the run-up, as a share of the commanded one
ARM_M = 0.1  # between the sensors that measure the robot's height and tilt
STILL_RAD = 1e-4  # half a turn below which a robot does not turn
READABLE_M = 0.5  # a greater error is that of a simulator whose rays do not see the ground


class TrialDrive(NamedTuple):
    """The real motion, besides what was commanded."""

    drift_mps: float  # at rest
    speed: float  # deviation from the command straight ahead, as a share of it
    turn: float  # deviation of the yaw rate at full lock, as a share of it
    sunk_m: float  # below the height that the description has at rest; 0 if it is not known
    tilt_deg: float  # at rest


@dataclass(frozen=True)
class Plumb:
    """A sensor that measures the distance from the ground below it."""

    measures: ClassVar[str] = RANGE
    period_s: float = 0.1
    range_min_m: float = 0.0
    range_max_m: float = 10.0
    size_m: Sequence[float] = (1e-3, 1e-3, 1e-3)
    mass_kg: float = 1e-6
    price: float = 0.0
    filters: Mapping[str, Filter] = field(default_factory=dict)

    @property
    def channels(self) -> tuple[Channel]:
        """The distance."""
        return (Channel("range", "m", self.range_min_m, self.range_max_m),)

    def rays(self) -> Array:
        """Return the only ray, down."""
        return np.array([[0.0, 0.0, -1.0]])

    def channel_of(self) -> NDArray[np.int64]:
        """Return the only channel."""
        return np.zeros(1, dtype=np.int64)

    def gazebo(self, name: str) -> str:
        """Return nothing: no file of a robot has this sensor."""
        return ""


def drive_trial(simulator: Simulator, robot: Robot, world: World, speed: float) -> TrialDrive:
    """Let the robot stand, drive straight and turn at full lock; ``speed`` is in [m/s].

    Raises:
        SimulationError: the engine refuses the robot.
    """
    link, height = robot.mount_link, robot.mount_z_m
    places = ((0.0, 0.0), (ARM_M, 0.0), (0.0, ARM_M))
    mounts = [Mount("plumb", link, x, y, height, 0.0, 0.0) for x, y in places]
    robot = replace(robot, occluders=Occluders()).with_sensors(mounts, {"plumb": Plumb()})
    lock, drive = robot.drive.steering_limit, robot.drive
    curvature = elementary.tan(lock) / drive.wheelbase_m
    fastest = drive.max_speed_mps / (1.0 + abs(curvature) * drive.speed_limit_offset_m)
    with simulator.open(robot, world) as simulation:
        driver = _Driver(simulation, simulator.time_step)
        driver.advance(0.0, 0.0, 0.5 * REST_S)
        drift, _ = driver.advance(0.0, 0.0, REST_S)
        sunk, tilt = _measure_posture(simulation, robot)
        straight, _ = driver.measure(speed, 0.0)
    with simulator.open(robot, world) as simulation:
        slower = min(speed, fastest)
        _, rate = _Driver(simulation, simulator.time_step).measure(slower, lock)
    commanded = slower * curvature * drive.turn_ratio
    return TrialDrive(drift, straight / speed - 1.0, rate / commanded - 1.0, sunk, tilt)


def find_turning_point(simulator: Simulator, robot: Robot, world: World, speed: float) -> float:
    """Return x [m], in the robot's frame, of the point that moves as the robot heads in a turn.

    It is NaN if the robot does not turn.

    Raises:
        SimulationError: the engine refuses the robot.
    """
    lock, drive = robot.drive.steering_limit, robot.drive
    curvature = elementary.tan(lock) / drive.wheelbase_m
    fastest = drive.max_speed_mps / (1.0 + abs(curvature) * drive.speed_limit_offset_m)
    with simulator.open(robot, world) as simulation:
        driver = _Driver(simulation, simulator.time_step)
        driver.measure(min(speed, fastest), lock)
        return driver.locate(min(speed, fastest), lock)


def _measure_posture(simulation: Simulation, robot: Robot) -> tuple[float, float]:
    """Return how far [m] the robot sank, and its tilt [deg]; zeros if its rays do not tell."""
    readings = np.zeros(robot.beam_count)
    simulation.sense(readings)
    errors = readings - robot.sensor_poses[:, 2]
    if not np.abs(errors).max() < READABLE_M:
        return 0.0, 0.0
    slope = math.hypot(errors[1] - errors[0], errors[2] - errors[0]) / ARM_M
    return max(0.0, -float(errors[0])), math.degrees(elementary.atan(slope))


class _Driver:
    def __init__(self, simulation: Simulation, time_step: float) -> None:
        self._simulation, self._step = simulation, time_step
        self._command = np.zeros(COMMAND_SIZE)

    def advance(self, speed: float, steering: float, duration: float) -> tuple[float, float]:
        """Drive for a duration [s]; return the mean speed [m/s] and yaw rate [rad/s]."""
        self._command[[DRIVE_SPEED, STEERING]] = speed, steering
        duration = max(1, round(duration / self._step)) * self._step
        before = self._observe()
        self._simulation.advance(self._command, duration)
        after = self._observe()
        turn = after[YAW] - before[YAW]
        if math.isfinite(turn):
            turn = math.remainder(turn, 2.0 * math.pi)
        return math.dist(before[[X, Y]], after[[X, Y]]) / duration, float(turn) / duration

    def measure(self, speed: float, steering: float) -> tuple[float, float]:
        """Return the mean speed and yaw rate after a run-up, in which servos and motors settle."""
        before = math.inf
        for _ in range(RUN_UP_PIECES):
            now, _ = self.advance(speed, steering, PIECE_S)
            if abs(now - before) <= SETTLED * speed:
                break
            before = now
        pieces = [self.advance(speed, steering, PIECE_S) for _ in range(DRIVE_PIECES)]
        speeds, rates = zip(*pieces, strict=True)
        return math.fsum(speeds) / DRIVE_PIECES, math.fsum(rates) / DRIVE_PIECES

    def locate(self, speed: float, steering: float) -> float:
        """Return x [m] of the point whose way during a piece is along the mean heading."""
        before = self._observe()
        self.advance(speed, steering, PIECE_S)
        after = self._observe()
        half = 0.5 * float(math.remainder(after[YAW] - before[YAW], 2.0 * math.pi))
        if abs(half) < STILL_RAD:
            return math.nan
        x, y = float(after[X] - before[X]), float(after[Y] - before[Y])
        heading = float(before[YAW]) + half
        return (elementary.sin(heading) * x - elementary.cos(heading) * y) / (
            2.0 * elementary.sin(half)
        )

    def _observe(self) -> Array:
        state = np.zeros(STATE_SIZE)
        self._simulation.observe(state)
        return state
