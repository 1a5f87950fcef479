"""Drives a robot in an engine on empty level ground and compares the motion with the commands."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import COMMAND_SIZE, DRIVE_SPEED, STATE_SIZE, STEERING, YAW, Array, X, Y
from evoros.drive.protocol import Drive, skids
from evoros.robot.model import Robot
from evoros.robot.outline import Occluders
from evoros.sensor.lidar import Lidar
from evoros.sensor.protocol import Mount
from evoros.simulator.protocol import Simulation, Simulator, open_alone
from evoros.world.model import World

REST_S, PIECE_S, RUN_UP_PIECES = 1.0, 0.25, 12
DRIVE_S, MAX_DRIVE_S = 2.0, 10.0
SETTLED = 0.02  # maximum relative change of speed between consecutive pieces of a settled run-up
ARM_M = 0.1  # [m], distance between the sensors that measure the robot's height and tilt
STILL_RAD = 1e-4  # half of the angle up to which a robot counts as driving straight
READABLE_M = 0.5  # [m], error above which rays have missed the ground


class Manoeuvre(NamedTuple):
    """A constant command: fractions of the maximum speed and of the maximum steering angle."""

    name: str
    speed: float
    lock: float


STRAIGHT, BACK = Manoeuvre("straight", 1.0, 0.0), Manoeuvre("back", -1.0, 0.0)
TURNS = (
    Manoeuvre("quarter lock", 1.0, 0.25),
    Manoeuvre("half lock", 1.0, -0.5),
    Manoeuvre("full lock", 1.0, 1.0),
)
MANOEUVRES = (STRAIGHT, BACK, *TURNS)


class Rest(NamedTuple):
    """The motion and posture of a robot after a command to stand still."""

    drift_mps: float
    sunk_m: float  # depth below the described height; 0 if unknown
    tilt_deg: float


class TrialDrive(NamedTuple):
    """The measured motion of a robot in an engine, relative to the commands."""

    rest: Rest
    shares: Mapping[Manoeuvre, float]  # speed, or yaw rate in a turn, relative to the command


PLUMB = Lidar(
    beams=1, range_min_m=0.0, range_max_m=10.0, size_m=(1e-3, 1e-3, 1e-3), mass_kg=1e-6, price=0.0
)
"""A downward range sensor that measures its height above the ground."""


class Trial:
    """A robot on level ground in an engine; methods raise SimulationError if it is rejected."""

    def __init__(self, simulator: Simulator, robot: Robot, world: World, speed: float) -> None:
        """Create the trial of a robot whose maximum speed is ``speed`` [m/s]."""
        places = ((0.0, 0.0), (ARM_M, 0.0), (0.0, ARM_M))
        height = robot.mount_z_m
        mounts = [Mount("plumb", robot.mount_link, x, y, height, 0.0, -90.0) for x, y in places]
        transparent = replace(robot, occluders=Occluders())  # plumb sensors see through this robot
        self._robot = transparent.with_sensors(mounts, {"plumb": PLUMB})
        self._simulator, self._world, self._speed = simulator, world, speed

    def run(self) -> TrialDrive:
        """Measure the robot at rest, then in each manoeuvre."""
        return TrialDrive(self.stand(), {move: self.drive(move) for move in MANOEUVRES})

    def stand(self) -> Rest:
        """Command the robot to stand still until it settles, then measure it."""
        with open_alone(self._simulator.open, self._robot, self._world) as simulation:
            driver = _Driver(simulation, self._simulator.time_step)
            driver.advance(0.0, 0.0, 0.5 * REST_S)
            drift, _ = driver.advance(0.0, 0.0, REST_S)
            return Rest(abs(drift), *_measure_posture(simulation, self._robot))

    def drive(self, manoeuvre: Manoeuvre) -> float:
        """Drive a manoeuvre; return the measured speed or yaw rate, relative to the command.

        A robot whose wheels slip turns by at least 90 deg (but for at most ``MAX_DRIVE_S``),
        because the friction of an engine may depend on the heading.
        """
        drive = self._robot.drive
        steering = manoeuvre.lock * drive.steering_limit
        curvature = elementary.tan(steering) / drive.wheelbase_m
        speed = manoeuvre.speed * min(self._speed, _limit_speed(drive, curvature))
        commanded = speed * curvature * drive.turn_ratio
        duration = DRIVE_S
        if commanded and skids(drive):
            duration = min(max(DRIVE_S, 0.5 * math.pi / abs(commanded)), MAX_DRIVE_S)
        with open_alone(self._simulator.open, self._robot, self._world) as simulation:
            driver = _Driver(simulation, self._simulator.time_step)
            reached, rate = driver.measure(speed, steering, duration)
        return rate / commanded if commanded else reached / speed


def _limit_speed(drive: Drive, curvature: float) -> float:
    return drive.max_speed_mps / (1.0 + abs(curvature) * drive.speed_limit_offset_m)


def find_turning_point(simulator: Simulator, robot: Robot, world: World, speed: float) -> float:
    """Return the x [m] of the point that moves along the heading while turning; NaN if none."""
    lock, drive = robot.drive.steering_limit, robot.drive
    speed = min(speed, _limit_speed(drive, elementary.tan(lock) / drive.wheelbase_m))
    with open_alone(simulator.open, robot, world) as simulation:
        driver = _Driver(simulation, simulator.time_step)
        driver.measure(speed, lock, DRIVE_S)
        return driver.locate(speed, lock)


def _measure_posture(simulation: Simulation, robot: Robot) -> tuple[float, float]:
    """Return how far the robot sank [m], and its tilt [deg]; zeros if rays miss the ground."""
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
        """Drive for ``duration`` [s]; return the mean speed (negative backwards) and yaw rate."""
        self._command[[DRIVE_SPEED, STEERING]] = speed, steering
        duration = max(1, round(duration / self._step)) * self._step
        before = self._observe()
        self._simulation.advance(self._command, duration)
        after = self._observe()
        turn = after[YAW] - before[YAW]
        if not math.isfinite(turn):
            return math.nan, math.nan
        turn = math.remainder(turn, 2.0 * math.pi)
        heading = float(before[YAW]) + 0.5 * turn
        x, y = float(after[X] - before[X]), float(after[Y] - before[Y])
        ahead = elementary.cos(heading) * x + elementary.sin(heading) * y
        return math.copysign(math.hypot(x, y), ahead) / duration, turn / duration

    def measure(self, speed: float, steering: float, duration: float) -> tuple[float, float]:
        """Return the mean speed and yaw rate after a run-up in which the motors settle."""
        before = math.inf
        for _ in range(RUN_UP_PIECES):
            now, _ = self.advance(speed, steering, PIECE_S)
            if abs(now - before) <= SETTLED * abs(speed):
                break
            before = now
        count = max(1, round(duration / PIECE_S))
        pieces = [self.advance(speed, steering, PIECE_S) for _ in range(count)]
        speeds, rates = zip(*pieces, strict=True)
        return math.fsum(speeds) / count, math.fsum(rates) / count

    def locate(self, speed: float, steering: float) -> float:
        """Return the x [m] of the point that moves along the mean heading during a piece."""
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


TOLERANCE = 0.05  # maximum relative deviation from the commanded motion
SKIDDING_TOLERANCE = 0.1  # if wheels slip, because the model assumes equal loads and point contacts
MAX_SUNK_M, MAX_TILT_DEG = 0.01, 5.0
ALIKE = 0.05  # maximum difference between deviations that share a message


class Setting(NamedTuple):
    """A robot on empty ground, and its maximum speed [m/s] straight ahead."""

    robot: Robot
    world: World
    speed: float

    def in_engine(self, simulator: Simulator) -> Trial:
        """Return the trial of the robot in an engine."""
        return Trial(simulator, *self)

    def with_drive(self, **changes: float) -> "Setting":
        """Return the setting with changed fields of the robot's drive."""
        drive: Any = replace(self.robot.drive, **changes)  # type: ignore[type-var]
        return self._replace(robot=replace(self.robot, drive=drive))

    def describe(self, trial: TrialDrive) -> str:
        """Describe the faults of a measured motion; empty if there are none."""
        if not all(map(math.isfinite, (*trial.rest, *trial.shares.values()))):
            return "has a pose that is not a number"
        faults = _describe_rest(trial.rest, self.speed)
        return " and ".join([*faults, *_describe_shares(trial.shares, self.robot.drive)])


def moves_right(setting: Setting, simulator: Simulator, before: TrialDrive) -> bool:
    """Return True if the robot moves as commanded, trying manoeuvres from worst to best."""
    trial = setting.in_engine(simulator)
    worst_first = sorted(MANOEUVRES, key=lambda move: -abs(before.shares[move] - 1.0))
    return not _describe_rest(trial.stand(), setting.speed) and not any(
        _describe_shares({move: trial.drive(move)}, setting.robot.drive) for move in worst_first
    )


def _describe_rest(rest: Rest, speed: float) -> list[str]:
    faults = []
    if not rest.tilt_deg <= MAX_TILT_DEG:
        faults.append(f"stands at a tilt of {rest.tilt_deg:.0f} deg")
    if not rest.sunk_m <= MAX_SUNK_M:
        faults.append(f"sinks {1e3 * rest.sunk_m:.0f} mm into the ground")
    if not rest.drift_mps <= TOLERANCE * speed:
        faults.append(f"drifts {1e3 * rest.drift_mps:.0f} mm/s at rest")
    return faults


def _describe_shares(shares: Mapping[Manoeuvre, float], drive: Drive) -> list[str]:
    turning = SKIDDING_TOLERANCE if skids(drive) else TOLERANCE
    wrong = {
        manoeuvre: share - 1.0
        for manoeuvre, share in shares.items()
        if not abs(share - 1.0) <= (turning if manoeuvre.lock else TOLERANCE)
    }
    faults = []
    if STRAIGHT in wrong and BACK in wrong and abs(wrong[STRAIGHT] - wrong[BACK]) < ALIKE:
        faults.append(_compare("drives", wrong[STRAIGHT]))
    else:
        names = ((STRAIGHT, "drives forward"), (BACK, "drives backward"))
        faults += [_compare(verb, wrong[move]) for move, verb in names if move in wrong]
    return faults + _describe_turns({move: wrong[move] for move in TURNS if move in wrong})


def _describe_turns(wrong: Mapping[Manoeuvre, float]) -> list[str]:
    deviations = list(wrong.values())
    if len(wrong) == len(TURNS) and (
        max(deviations) - min(deviations) < ALIKE or max(deviations) < -0.9
    ):
        return [_compare("turns", deviations[-1])]
    parts = [f"{_compare('turns', wrong[move])} at {move.name}" for move in wrong]
    shortened = [part.replace("turns ", "").replace(" than commanded", "") for part in parts[1:]]
    return [", ".join([*parts[:1], *shortened])] if parts else []


def _compare(verb: str, deviation: float) -> str:
    if deviation < -1.1:
        return f"{verb} the other way"
    if deviation < -0.9:
        return f"hardly {verb} at all"
    direction = "faster" if deviation > 0 else "slower"
    return f"{verb} {100 * abs(deviation):.0f} % {direction} than commanded"
