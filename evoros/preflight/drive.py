"""Detects a time step that is too coarse by driving the robot briefly before the run.

Every change that is proposed has been tested in such a drive.
"""

import dataclasses
import logging
import math
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import CancelledError
from importlib.util import find_spec
from typing import Any, NamedTuple

from evoros.base import elementary
from evoros.base.checks import LEAST_STEP_S
from evoros.base.errors import SimulationError, single_line
from evoros.drive.protocol import Drive, skids
from evoros.drive.skid_steer import SkidSteer
from evoros.evolution.experiment import Experiment
from evoros.executor.protocol import Pool
from evoros.mission.member import Member
from evoros.preflight.scene import Subject, find_values, list_subjects
from evoros.preflight.trial_drive import (
    BACK,
    MANOEUVRES,
    STRAIGHT,
    TURNS,
    Manoeuvre,
    Rest,
    Trial,
    TrialDrive,
    find_turning_point,
)
from evoros.robot.model import Robot
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.protocol import RuleSimulator, Simulator
from evoros.world.course import Course
from evoros.world.floors import GROUND
from evoros.world.model import World

TOLERANCE = 0.05  # relative to the commanded motion
SKIDDING_TOLERANCE = 0.1  # wider if wheels slip: the model assumes equal loads and points
MAX_SUNK_M, MAX_TILT_DEG = 0.01, 5.0
ALIKE = 0.05  # maximum difference between deviations that are reported together
FIRM_GRIP_MPS2 = 8.0  # lateral acceleration above which wheels slip on common ground
RIGHT = ", in which the robot moves as commanded"


class Setting(NamedTuple):
    """A robot on empty ground, and the speed [m/s] at which it drives straight ahead."""

    robot: Robot
    world: World
    speed: float

    def in_engine(self, simulator: Simulator) -> Trial:
        """Return the trial drive in a given engine."""
        return Trial(simulator, *self)

    def describe(self, trial: TrialDrive) -> str:
        """Describe the faults of the motion; empty if there are none."""
        if not all(map(math.isfinite, (*trial.rest, *trial.shares.values()))):
            return "has a pose that is not a number"
        faults = _describe_rest(trial.rest, self.speed)
        return " and ".join([*faults, *_describe_shares(trial.shares, self.robot.drive)])


def moves_right(setting: Setting, simulator: Simulator, before: TrialDrive) -> bool:
    """Return True if a robot performs all manoeuvres as commanded; the worst is tried first."""
    trial = setting.in_engine(simulator)
    worst_first = sorted(MANOEUVRES, key=lambda move: -abs(before.shares[move] - 1.0))
    return not _describe_rest(trial.stand(), setting.speed) and not any(
        _describe_shares({move: trial.drive(move)}, setting.robot.drive) for move in worst_first
    )


def advise(key: str, simulator: Simulator, setting: Setting, trial: TrialDrive) -> str:
    """Suggest a change if no finer step helps; ``trial`` used the configured step."""
    drive, speed = setting.robot.drive, setting.speed
    shares = {move: 1.0 if move.lock else share for move, share in trial.shares.items()}
    only_turns = not setting.describe(trial._replace(shares=shares))
    push = speed * speed * elementary.tan(drive.steering_limit) / drive.wheelbase_m
    if only_turns and push > FIRM_GRIP_MPS2:
        return (
            f"the tightest turn at {speed:g} m/s needs more friction than wheels provide; lower "
            f"speed_mps of the controller or robot.drive.steering_limit_rad"
        )
    resistance = _find_resistance(simulator, setting, trial) if only_turns else None
    if resistance is not None:
        return (
            f"set robot.drive.turning_resistance={resistance:g}, with which the robot moves as "
            "commanded"
        )
    limit = _find_limit(simulator, setting, trial) if only_turns else None
    if limit is not None:
        return (
            f"lower robot.drive.steering_limit_rad to {limit:g}, up to which it turns as commanded"
        )
    general = (
        "check the drive's wheels, casters and effort limits, the friction, the masses and the "
        "collision shapes against the real robot"
    )
    if isinstance(simulator, Mujoco):
        return general
    advice = advise_mujoco([key], setting, simulator)
    return advice if advice.endswith(RIGHT) else general


def _find_resistance(simulator: Simulator, setting: Setting, trial: TrialDrive) -> float | None:
    """Return a turning resistance at which a skid-steer robot drives as commanded, or None."""
    drive, shares = setting.robot.drive, [trial.shares[move] for move in TURNS]
    share = 0.5 * (max(shares) + min(shares))
    if not isinstance(drive, SkidSteer) or not skids(drive):
        return None
    if drive.turn_ratio != 1.0 or not share > 0.0:
        return None
    resistance = float(f"{drive.turning_resistance / share:.3g}")
    if resistance < 1.0:
        return None
    changed = dataclasses.replace(
        drive, turning_resistance=resistance, wheel_separation_multiplier=resistance
    )
    corrected = setting._replace(robot=dataclasses.replace(setting.robot, drive=changed))
    return resistance if moves_right(corrected, simulator, trial) else None


def _find_limit(simulator: Simulator, setting: Setting, trial: TrialDrive) -> float | None:
    """Return a lower limit [rad] at which a skid-steer robot turns as commanded, or None."""
    drive = setting.robot.drive
    if not isinstance(drive, SkidSteer):
        return None
    for share in (0.75, 0.5):
        limit = float(f"{share * drive.steering_limit:.2g}")
        changed = dataclasses.replace(drive, steering_limit_rad=limit)
        lower = setting._replace(robot=dataclasses.replace(setting.robot, drive=changed))
        if moves_right(lower, simulator, trial):
            return limit
    return None


def choose_mujoco(key: str) -> str:
    """Return the override that selects MuJoCo for a key."""
    return "simulator=mujoco" if key == "simulator" else f"simulator@{key}=mujoco"


def advise_mujoco(keys: Iterable[str], setting: Setting, simulator: Simulator) -> str:
    """Drive in MuJoCo at its default step with all other settings kept; describe the motion."""
    choice = " ".join(map(choose_mujoco, keys))
    if find_spec("mujoco") is None:
        return f"use {choice} (MuJoCo is not installed: pip install mujoco-core)"
    names = ("wheel_friction", "steering_lag_s")
    mujoco = Mujoco(
        **{name: getattr(simulator, name) for name in names if hasattr(simulator, name)}
    )
    try:
        trial = setting.in_engine(mujoco).run()
        faults = setting.describe(trial)
        resistance = _find_resistance(mujoco, setting, trial) if faults else None
    except SimulationError as error:
        return f"{choice} does not help: {error}"
    if resistance is not None:
        return f"use {choice} robot.drive.turning_resistance={resistance:g}{RIGHT}"
    return f"use {choice}{f', in which the robot {faults}' if faults else RIGHT}"


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


_LOG = logging.getLogger(__name__)

MAX_HALVINGS = 5
FINE_ITERATIONS = 50  # minimum number of solver iterations at finer steps


def report_drive(experiment: Experiment, pool: Pool) -> None:
    """Have a worker drive the robot in each engine, and warn if it does not move as commanded.

    A worker is used because an engine may crash its process. Rule simulators are skipped, because
    robots always move as commanded there.
    """
    if all(isinstance(simulator, RuleSimulator) for simulator in _simulators(experiment).values()):
        return
    try:
        warnings = pool.submit(check_drive, experiment).result()
    except CancelledError:  # the pool was closed because the run was interrupted
        raise
    except Exception as error:  # an engine or a user's simulator may raise anything
        warnings = [
            f"a short drive before the run failed ({single_line(error)}); missions may fail, too"
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
    """Yield the warnings about some engines; end with a warning if an engine rejects the robot."""
    try:
        yield from warnings
    except SimulationError as error:
        yield f"{' and '.join(keys)}: every mission would fail: {error}"


def choose_speed(member: Member) -> float:
    """Return the maximum speed [m/s] that both the controller and the drive allow."""
    speeds = [value for _, value in find_values(member.controller, "speed_mps", "controller")]
    return min(max(speeds, default=math.inf), member.robot.drive.max_speed_mps)


def _tell_doubt(simulators: Mapping[str, Simulator], setting: Setting) -> Iterator[str]:
    """Yield the warning about engines that simulate a drive inaccurately at any time step."""
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
    finest = simulator
    for finer in _refine(simulator):
        finest = finer
        if moves_right(setting, finer, trial):
            fix = f"set {_settings(key, finer)}, with which the robot moves as commanded"
            break
    else:
        fix = f"no time step down to {finest.time_step:g} s corrects that; "
        fix += advise(key, simulator, setting, trial)
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


def _refine(simulator: Any) -> Iterator[Simulator]:
    """Yield the simulator with repeatedly halved steps; each step divides all periods."""
    if not dataclasses.is_dataclass(simulator):
        return
    part: Any = simulator
    changes = {}
    if isinstance(iterations := getattr(part, "solver_iterations", None), int):
        changes["solver_iterations"] = max(iterations, FINE_ITERATIONS)
    for halvings in range(1, MAX_HALVINGS + 1):
        step = part.time_step / 2**halvings
        if step >= LEAST_STEP_S:
            yield dataclasses.replace(part, time_step=step, **changes)


def _settings(key: str, simulator: Any) -> str:
    names = ("time_step", "solver_iterations")
    values = {name: getattr(simulator, name, None) for name in names}
    return " ".join(f"{key}.{name}={value:.10g}" for name, value in values.items() if value)
