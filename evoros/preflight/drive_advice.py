"""Describes how a robot moves differently than commanded, and finds changes that correct it.

Every proposed change has been driven.
"""

import dataclasses
import math
from collections.abc import Mapping
from importlib.util import find_spec
from typing import NamedTuple

from evoros.base import elementary
from evoros.base.errors import SimulationError
from evoros.drive.protocol import Drive
from evoros.drive.skid_steer import SkidSteer
from evoros.drive.wheels import skids
from evoros.preflight.trial_drive import (
    BACK,
    MANOEUVRES,
    STRAIGHT,
    TURNS,
    Manoeuvre,
    Rest,
    Trial,
    TrialDrive,
)
from evoros.robot.model import Robot
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.protocol import Simulator
from evoros.world.model import World

TOLERANCE = 0.05  # as a share of the commanded motion
SKIDDING_TOLERANCE = 0.1
"""The tolerance of turns on wheels that slip. Their turning resistance assumes equal loads on
wheels that touch the ground in a point."""
MAX_SUNK_M, MAX_TILT_DEG = 0.01, 5.0
ALIKE = 0.05  # maximum difference of deviations that are reported as one
FIRM_GRIP_MPS2 = 8.0
"""The acceleration across the wheels above which they slip on common ground."""
RIGHT = ", in which it moves as commanded"


class Setting(NamedTuple):
    """A robot on empty ground, and its speed [m/s] straight ahead."""

    robot: Robot
    world: World
    speed: float

    def in_engine(self, simulator: Simulator) -> Trial:
        """Return the trial in an engine."""
        return Trial(simulator, *self)

    def describe(self, trial: TrialDrive) -> str:
        """Return the faults of the motion; an empty text if none."""
        return _describe(trial, self.robot.drive, self.speed)


def moves_right(setting: Setting, simulator: Simulator, before: TrialDrive) -> bool:
    """Return whether a robot drives all manoeuvres; those that were worst come first."""
    trial = setting.in_engine(simulator)
    worst_first = sorted(MANOEUVRES, key=lambda move: -abs(before.shares[move] - 1.0))
    return not _describe_rest(trial.stand(), setting.speed) and not any(
        _describe_shares({move: trial.drive(move)}, setting.robot.drive) for move in worst_first
    )


def advise(key: str, simulator: Simulator, setting: Setting, trial: TrialDrive) -> str:
    """Return the change to make if no finer step helps; ``trial`` is the drive at the given one."""
    drive, speed = setting.robot.drive, setting.speed
    only_turns = not setting.describe(_without_turns(trial))
    push = speed * speed * elementary.tan(drive.steering_limit) / drive.wheelbase_m
    if only_turns and push > FIRM_GRIP_MPS2:
        return (
            f"the tightest turn at {speed:g} m/s needs more friction than wheels have; lower "
            f"speed_mps of the controller or robot.drive.steering_limit_rad"
        )
    resistance = _find_resistance(simulator, setting, trial) if only_turns else None
    if resistance is not None:
        return (
            f"set robot.drive.turning_resistance={resistance:g}, with which it moves as commanded"
        )
    general = (
        "compare the drive's wheels, casters and limits of effort, the friction, the masses and "
        "the collision shapes with the robot's"
    )
    if isinstance(simulator, Mujoco):
        return general
    outcome = try_mujoco(setting, simulator)
    return f"use {choose_mujoco(key)}{outcome}" if outcome == RIGHT else general


def _without_turns(trial: TrialDrive) -> TrialDrive:
    return trial._replace(
        shares={move: 1.0 if move.lock else s for move, s in trial.shares.items()}
    )


def _find_resistance(simulator: Simulator, setting: Setting, trial: TrialDrive) -> float | None:
    """Return a turning resistance with which a skid-steer robot was driven as commanded."""
    drive, shares = setting.robot.drive, [trial.shares[move] for move in TURNS]
    share = 0.5 * (max(shares) + min(shares))
    if not isinstance(drive, SkidSteer) or drive.turn_ratio != 1.0 or not share > 0.0:
        return None
    resistance = float(f"{drive.turning_resistance / share:.3g}")
    if resistance < 1.0:
        return None
    changed = dataclasses.replace(
        drive, turning_resistance=resistance, wheel_separation_multiplier=resistance
    )
    corrected = setting._replace(robot=dataclasses.replace(setting.robot, drive=changed))
    return resistance if moves_right(corrected, simulator, trial) else None


def choose_mujoco(key: str) -> str:
    """Return the override that chooses MuJoCo for a key."""
    return "simulator=mujoco" if key == "simulator" else f"simulator@{key}=mujoco"


def try_mujoco(setting: Setting, simulator: Simulator) -> str:
    """Drive in MuJoCo at its default step, otherwise as in a simulator; describe the motion."""
    if find_spec("mujoco") is None:
        return " (it is not installed: pip install mujoco-core)"
    names = ("wheel_friction", "steering_lag_s")
    mujoco = Mujoco(
        **{name: getattr(simulator, name) for name in names if hasattr(simulator, name)}
    )
    try:
        trial = setting.in_engine(mujoco).run()
        faults = setting.describe(trial)
        resistance = _find_resistance(mujoco, setting, trial) if faults else None
    except SimulationError as error:
        return f", although it refuses the robot: {error}"
    if resistance is not None:
        return f" robot.drive.turning_resistance={resistance:g}{RIGHT}"
    return f", in which it {faults}" if faults else RIGHT


def _describe(trial: TrialDrive, drive: Drive, speed: float) -> str:
    """Return the faults of a robot's motion at a speed [m/s]; an empty text if none."""
    if not all(map(math.isfinite, (*trial.rest, *trial.shares.values()))):
        return "has a pose that is no number"
    faults = [*_describe_rest(trial.rest, speed), *_describe_shares(trial.shares, drive)]
    return " and ".join(faults)


def _describe_rest(rest: Rest, speed: float) -> list[str]:
    """Return the faults of a robot at rest."""
    faults = []
    if not rest.tilt_deg <= MAX_TILT_DEG:
        faults.append(f"stands at a tilt of {rest.tilt_deg:.0f} deg")
    if not rest.sunk_m <= MAX_SUNK_M:
        faults.append(f"sinks {1e3 * rest.sunk_m:.0f} mm into the ground")
    if not rest.drift_mps <= TOLERANCE * speed:
        faults.append(f"drifts {1e3 * rest.drift_mps:.0f} mm/s at rest")
    return faults


def _describe_shares(shares: Mapping[Manoeuvre, float], drive: Drive) -> list[str]:
    """Return which of some manoeuvres a robot does not drive as commanded."""
    wrong = {
        manoeuvre: share - 1.0
        for manoeuvre, share in shares.items()
        if not abs(share - 1.0) <= _find_tolerance(manoeuvre, drive)
    }
    faults = []
    if STRAIGHT in wrong and BACK in wrong and abs(wrong[STRAIGHT] - wrong[BACK]) < ALIKE:
        faults.append(_compare("drives", wrong[STRAIGHT]))
    else:
        names = ((STRAIGHT, "drives ahead"), (BACK, "drives back"))
        faults += [_compare(verb, wrong[move]) for move, verb in names if move in wrong]
    return faults + _describe_turns({move: wrong[move] for move in TURNS if move in wrong})


def _find_tolerance(manoeuvre: Manoeuvre, drive: Drive) -> float:
    """Return how far a share may be from 1."""
    return SKIDDING_TOLERANCE if manoeuvre.lock and skids(drive) else TOLERANCE


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
