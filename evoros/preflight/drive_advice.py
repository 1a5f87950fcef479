"""Finds changes with which a robot moves as commanded; every proposal has been driven."""

import dataclasses
from importlib.util import find_spec
from typing import NamedTuple

from evoros.base import elementary
from evoros.base.errors import SimulationError
from evoros.drive.skid_steer import SkidSteer
from evoros.preflight.drive_faults import describe, describe_rest, describe_shares
from evoros.preflight.trial_drive import MANOEUVRES, TURNS, Trial, TrialDrive
from evoros.robot.model import Robot
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.protocol import Simulator
from evoros.world.model import World

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
        return describe(trial, self.robot.drive, self.speed)


def moves_right(setting: Setting, simulator: Simulator, before: TrialDrive) -> bool:
    """Return whether a robot drives all manoeuvres; those that were worst come first."""
    trial = setting.in_engine(simulator)
    worst_first = sorted(MANOEUVRES, key=lambda move: -abs(before.shares[move] - 1.0))
    return not describe_rest(trial.stand(), setting.speed) and not any(
        describe_shares({move: trial.drive(move)}, setting.robot.drive) for move in worst_first
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
