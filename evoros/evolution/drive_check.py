"""Finds a step that is too coarse for a robot in an engine, by a short drive before the run."""

import dataclasses
import math
from collections.abc import Iterator
from concurrent.futures import CancelledError
from typing import Any

from evoros.base import elementary
from evoros.base.errors import SimulationError, single_line
from evoros.base.log import LOGGER
from evoros.evolution.experiment import Experiment
from evoros.evolution.layer_values import find_values
from evoros.evolution.trial_drive import TrialDrive, drive_trial, find_turning_point
from evoros.executor.protocol import Pool
from evoros.robot.model import Robot
from evoros.simulator.protocol import RuleSimulator, Simulator
from evoros.world.course import Course
from evoros.world.floors import GROUND
from evoros.world.model import World

TOLERANCE = 0.05  # as a share of the commanded motion
MAX_SUNK_M, MAX_TILT_DEG = 0.01, 5.0
MAX_HALVINGS = 5
FIRM_GRIP_MPS2 = 8.0
"""The acceleration across the wheels above which they slip on common ground."""
FINE_ITERATIONS = 50  # of a solver of contacts, at the finer steps


def report_drive(experiment: Experiment, pool: Pool) -> None:
    """Let a worker drive the robot in each engine, and log where it does not move as commanded.

    A worker, because an engine may crash its process. A simulator that consists of rules is left
    out, because its robot does nothing else.
    """
    if all(isinstance(simulator, RuleSimulator) for simulator in _simulators(experiment).values()):
        return
    try:
        warnings = pool.submit(list_warnings, experiment).result()
    except CancelledError:  # the pool was closed: the run is interrupted
        raise
    except Exception as error:  # of the engine or of a simulator of the user's own
        warnings = [
            f"a short drive before the run failed ({single_line(error)}); missions may, too"
        ]
    for warning in warnings:
        LOGGER.warning("%s", warning)


def list_warnings(experiment: Experiment) -> list[str]:
    """List a warning for each engine in which the robot does not move as commanded."""
    return list(check_drive(experiment))


def _simulators(experiment: Experiment) -> dict[str, Simulator]:
    simulators = {"simulator": experiment.simulator}
    if experiment.confirming.simulator != experiment.simulator:
        simulators["confirmation.simulator"] = experiment.confirming.simulator
    return simulators


def check_drive(experiment: Experiment) -> Iterator[str]:
    """Yield the warnings of ``list_warnings``, for each different robot."""
    for name, member in experiment.members.items():
        if name and experiment.agents[name].robot is None:
            continue
        robot = f"agents.{name}: " if name else ""
        for key, simulator in _simulators(member).items():
            if not isinstance(simulator, RuleSimulator):
                try:
                    for warning in _check(key, simulator, member):
                        yield robot + warning
                except SimulationError as error:
                    yield f"{robot}{key}: every mission would fail, because of this: {error}"


def _check(key: str, simulator: Simulator, experiment: Experiment) -> Iterator[str]:
    robot, world = experiment.robot, _empty_world(next(iter(experiment.world.values())))
    speeds = [value for _, value in find_values(experiment.controller, "speed_mps", "controller")]
    speed = min(max(speeds, default=math.inf), robot.drive.max_speed_mps)
    found = drive_trial(simulator, robot, world, speed)
    faults = _describe(found, speed)
    if not faults:
        yield from _check_turning_point(key, simulator, robot, world, speed)
        return
    trial, fix = found, ""
    for finer in _refine(simulator):
        trial = drive_trial(finer, robot, world, speed)
        if not _describe(trial, speed):
            fix = f"set {_settings(key, finer)}, with which it moves as commanded"
            break
    else:
        fix = _advise(trial, robot, speed)
    yield f"{key}: at time_step={simulator.time_step:g}, {robot.name} {faults}; {fix}"


def _check_turning_point(
    key: str, simulator: Simulator, robot: Robot, world: World, speed: float
) -> Iterator[str]:
    """Yield a warning if the robot does not slide as its drive states."""
    drive = robot.drive
    if not getattr(drive, "slide_m", 0.0):
        return
    found = find_turning_point(simulator, robot, world, speed)
    if not abs(found - drive.rear_axle_x_m) <= TOLERANCE * drive.wheelbase_m:
        yield (
            f"{key}: {robot.name} turns about x={found:.2f} m and not about "
            f"robot.drive.turning_x_m={drive.rear_axle_x_m:g}, because its wheels roll there; use "
            f"simulator=planar, or set robot.drive.turning_x_m=null"
        )


def _empty_world(world: World) -> World:
    """Return level ground with the gravity and the ground's friction of a world."""
    frictions = [body.friction for body in world.bodies if body.is_ground]
    ground = dataclasses.replace(GROUND, friction=max(frictions, default=GROUND.friction))
    height = world.course.home_z_m
    course = Course(0.0, 0.0, height, 0.0, [[10.0, 0.0]], 1.0, 1.0, "forward", False)
    return World("empty", (ground,), course, "preflight", "", gravity_mps2=world.gravity_mps2)


def _refine(simulator: Any) -> Iterator[Simulator]:
    """Yield the simulator with ever finer steps, which divide every period that its own divides."""
    if not dataclasses.is_dataclass(simulator):
        return
    part: Any = simulator
    changes = {}
    if isinstance(iterations := getattr(part, "solver_iterations", None), int):
        changes["solver_iterations"] = max(iterations, FINE_ITERATIONS)
    for halvings in range(1, MAX_HALVINGS + 1):
        yield dataclasses.replace(part, time_step=part.time_step / 2**halvings, **changes)


def _settings(key: str, simulator: Any) -> str:
    names = ("time_step", "solver_iterations")
    values = {name: getattr(simulator, name, None) for name in names}
    return " ".join(f"{key}.{name}={value:g}" for name, value in values.items() if value)


def _describe(trial: TrialDrive, speed: float) -> str:
    """Return what the robot does wrong; an empty text if nothing."""
    if not all(map(math.isfinite, trial)):
        return "has a pose that is no number"
    faults = []
    if trial.tilt_deg > MAX_TILT_DEG:
        faults.append(f"stands at a tilt of {trial.tilt_deg:.0f} deg")
    if trial.sunk_m > MAX_SUNK_M:
        faults.append(f"sinks {1e3 * trial.sunk_m:.0f} mm into the ground")
    if trial.drift_mps > TOLERANCE * speed:
        faults.append(f"drifts {1e3 * trial.drift_mps:.0f} mm/s at rest")
    if abs(trial.speed) > TOLERANCE:
        faults.append(_compare("drives", trial.speed))
    if abs(trial.turn) > TOLERANCE:
        faults.append(_compare("turns", trial.turn))
    return " and ".join(faults)


def _compare(verb: str, deviation: float) -> str:
    if deviation < -0.9:
        return f"hardly {verb} at all"
    direction = "faster" if deviation > 0 else "slower"
    return f"{verb} {100 * abs(deviation):.0f} % {direction} than commanded"


def _advise(trial: TrialDrive, robot: Robot, speed: float) -> str:
    """Return what to correct if no finer step helps."""
    same, drive = "a finer step does not change that", robot.drive
    only_turn = not _describe(trial._replace(turn=0.0), math.inf)
    push = speed * speed * elementary.tan(drive.steering_limit) / drive.wheelbase_m
    if only_turn and push > FIRM_GRIP_MPS2:
        return (
            f"{same}, because the tightest turn at {speed:g} m/s needs more friction than wheels "
            f"have; lower speed_mps of the controller or robot.drive.steering_limit_rad"
        )
    resistance = getattr(drive, "turning_resistance", None)
    if resistance is not None and only_turn and trial.turn > -0.9:
        return (
            f"{same}; set robot.drive.turning_resistance={resistance / (1.0 + trial.turn):.3g} for "
            f"simulators that do not compute it"
        )
    return (
        f"{same}; compare the drive's wheels, casters and limits of effort, the friction, the "
        f"masses and the collision shapes with the robot's"
    )
