"""Detects time steps that are too coarse, by briefly driving the robot before the run."""

import dataclasses
import logging
import math
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import CancelledError

from evoros.base.errors import SimulationError, single_line
from evoros.evolution.experiment import Experiment
from evoros.executor.protocol import Pool
from evoros.mission.member import Member
from evoros.preflight.advice import advise, advise_mujoco
from evoros.preflight.scene import Subject, find_values, list_subjects
from evoros.preflight.trial_drive import TOLERANCE, Setting, find_turning_point
from evoros.robot.model import Robot
from evoros.simulator.protocol import RuleSimulator, Simulator
from evoros.world.course import Course
from evoros.world.floors import GROUND
from evoros.world.model import World

_LOG = logging.getLogger(__name__)


def report_drive(experiment: Experiment, pool: Pool) -> None:
    """Let a worker drive the robot in each engine; warn if it does not move as commanded."""
    if all(isinstance(simulator, RuleSimulator) for simulator in _simulators(experiment).values()):
        return
    try:
        warnings = pool.submit(check_drive, experiment).result()
    except CancelledError:  # the run was interrupted, which closed the pool
        raise
    except Exception as error:  # an engine or a user's simulator may raise any exception
        warnings = [
            f"a short drive before the run failed ({single_line(error)}); missions may also fail"
        ]
    for warning in warnings:
        _LOG.warning("%s", warning)


def _simulators(tried: Experiment | Subject) -> dict[str, Simulator]:
    simulators = {"simulator": tried.scenario.simulator}
    if tried.confirming.simulator != tried.scenario.simulator:
        simulators["confirmation.simulator"] = tried.confirming.simulator
    return simulators


def check_drive(experiment: Experiment) -> list[str]:
    """Return a warning for each engine in which a robot does not move as commanded."""
    robots: list[Robot] = []
    warnings: list[str] = []
    for subject, member in zip(list_subjects(experiment), experiment.members, strict=True):
        if member.robot not in robots:
            robots.append(member.robot)
            warnings += map(member.tell, _check_subject(subject))
    return warnings


def _check_subject(subject: Subject) -> Iterator[str]:
    world = empty_world(next(iter(subject.scenario.world.values())))
    setting = Setting(subject.member.robot, world, choose_speed(subject.scenario.members[0]))
    drive = subject.member.robot.drive
    engines = {k: s for k, s in _simulators(subject).items() if not isinstance(s, RuleSimulator)}
    doubted = {key: engines.pop(key) for key in list(engines) if engines[key].doubt_drive(drive)}
    if doubted:
        yield from _guard(doubted, _tell_doubt(doubted, setting))
    for key, simulator in engines.items():
        yield from _guard([key], _check(key, simulator, setting))


def _guard(keys: Iterable[str], warnings: Iterator[str]) -> Iterator[str]:
    """Yield the warnings about engines; warn and stop if an engine rejects the robot."""
    try:
        yield from warnings
    except SimulationError as error:
        yield f"{' and '.join(keys)}: every mission would fail: {error}"


def choose_speed(member: Member) -> float:
    """Return the maximum speed [m/s] allowed by both controller and drive."""
    speeds = [value for _, value in find_values(member.controller, "speed_mps", "controller")]
    return min(max(speeds, default=math.inf), member.robot.drive.max_speed_mps)


def _tell_doubt(simulators: Mapping[str, Simulator], setting: Setting) -> Iterator[str]:
    """Yield the warning about engines that are inaccurate for a drive at any time step."""
    first = next(iter(simulators.values()))
    faults = setting.describe(setting.in_engine(first).run())
    shown = (
        (f"{faults}, and no smaller time step corrects that")
        if faults
        else "cannot be driven accurately"
    )
    yield (
        f"{' and '.join(simulators)}: {setting.robot.name} {shown}, because "
        f"{first.doubt_drive(setting.robot.drive)}; {advise_mujoco(simulators, setting, first)}"
    )


def _check(key: str, simulator: Simulator, setting: Setting) -> Iterator[str]:
    trial = setting.in_engine(simulator).run()
    faults = setting.describe(trial)
    if not faults:
        yield from _check_turning_point(key, simulator, *setting)
        return
    fix = advise(key, simulator, setting, trial)
    yield f"{key}: at time_step={simulator.time_step:g}, {setting.robot.name} {faults}; {fix}"


def _check_turning_point(
    key: str, simulator: Simulator, robot: Robot, world: World, speed: float
) -> Iterator[str]:
    drive = robot.drive
    if not getattr(drive, "slide_m", 0.0):
        return
    turning_x = find_turning_point(simulator, robot, world, speed)
    if not abs(turning_x - drive.rear_axle_x_m) <= TOLERANCE * drive.wheelbase_m:
        yield (
            f"{key}: {robot.name} turns about x={turning_x:.2f} m, where its wheels roll without "
            f"slipping, not about robot.drive.turning_x_m={drive.rear_axle_x_m:g}; use "
            f"simulator=planar, or set robot.drive.turning_x_m=null"
        )


def empty_world(world: World) -> World:
    """Return level ground with the gravity and ground friction of a world."""
    frictions = [body.friction for body in world.bodies if body.is_ground]
    ground = dataclasses.replace(GROUND, friction=max(frictions, default=GROUND.friction))
    height = world.course.home_z_m
    course = Course(0.0, 0.0, height, 0.0, [[10.0, 0.0]], 1.0, 1.0, "forward", False)
    return World(
        "empty level ground", (ground,), course, "preflight", "", gravity_mps2=world.gravity_mps2
    )
