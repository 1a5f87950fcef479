"""Proposes changes with which a robot moves as commanded; each was tried in a short drive."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from importlib.util import find_spec
from typing import Any

from evoros.base import elementary
from evoros.base.errors import SimulationError
from evoros.drive.protocol import skids
from evoros.drive.skid_steer import SkidSteer
from evoros.formats.urdf.tree import UrdfDocument
from evoros.preflight.trial_drive import TURNS, Setting, TrialDrive, moves_right
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.protocol import Simulator

FIRM_GRIP_MPS2 = 8.0  # lateral acceleration above which wheels slip on common ground
RIGHT = ", in which the robot moves as commanded"
SOFT = (0.6, 0.5)
"""Impedances of softer ground, which keeps the wheels of most hopping robots down."""


def advise(key: str, simulator: Simulator, setting: Setting, trial: TrialDrive) -> str:
    """Suggest a change if no finer step helps; ``trial`` used the configured step."""
    drive, speed = setting.robot.drive, setting.speed
    shares = {move: 1.0 if move.lock else share for move, share in trial.shares.items()}
    if not setting.describe(trial._replace(shares=shares)):  # deviates only in turns
        push = speed * speed * elementary.tan(drive.steering_limit) / drive.wheelbase_m
        if push > FIRM_GRIP_MPS2:
            return (
                f"the tightest turn at {speed:g} m/s needs more friction than wheels provide; "
                f"lower speed_mps of the controller or robot.drive.steering_limit_rad"
            )
        changes = (*_list_changes(key, simulator, setting, trial), *_strengthen(setting, simulator))
        for words, changed, engine in changes:
            if moves_right(changed, engine, trial):
                return f"{words}, with which the robot moves as commanded"
    advice = "" if isinstance(simulator, Mujoco) else advise_mujoco([key], setting, simulator)
    if advice.endswith(RIGHT):
        return advice
    return (
        "check the drive's wheels, casters and effort limits, the friction, the masses and the "
        f"collision shapes against the real robot, or use {choose(key, 'planar')}{RIGHT}"
    )


Change = tuple[str, Setting, Simulator]
"""Advice, and the robot and the engine that it results in."""


def _list_changes(
    key: str, simulator: Simulator, setting: Setting, trial: TrialDrive
) -> Iterator[Change]:
    """Yield changes with which a skid-steer robot may turn as commanded."""
    drive = setting.robot.drive
    if not isinstance(drive, SkidSteer):
        return
    if skids(drive):
        yield from _list_resistances("set", simulator, setting, trial)
    softens = skids(drive) and isinstance(simulator, Mujoco)
    for value in SOFT if softens else ():
        softer = replace(simulator, slip_impedance=value)  # type: ignore[type-var]
        words = f"set {key}.slip_impedance={value}"
        yield words, setting, softer
        yield from _list_resistances(words, softer, setting, setting.in_engine(softer).run())
    for share in (0.75, 0.5):
        limit = float(f"{share * drive.steering_limit:.2g}")
        changed = setting.with_drive(steering_limit_rad=limit)
        yield f"set robot.drive.steering_limit_rad={limit:g}", changed, simulator


def _list_resistances(
    words: str, simulator: Simulator, setting: Setting, trial: TrialDrive
) -> Iterator[Change]:
    """Yield the turning resistance that explains the turns of a skid-steer robot, if any does."""
    drive: Any = setting.robot.drive
    shares = [trial.shares[move] for move in TURNS]
    share = 0.5 * (max(shares) + min(shares))
    if not skids(drive) or drive.turn_ratio != 1.0 or not share > 0.0:
        return
    value = float(f"{drive.turning_resistance / share:.3g}")
    if value >= 1.0:
        changed = setting.with_drive(turning_resistance=value, wheel_separation_multiplier=value)
        yield f"{words} robot.drive.turning_resistance={value:g}", changed, simulator


def _strengthen(setting: Setting, simulator: Simulator) -> Iterator[Change]:
    """Yield the change that raises the wheels' effort limits."""
    robot = setting.robot
    for factor in (2.0, 4.0):
        elements, efforts = (robot.engine_urdf or robot.base_urdf).copy_elements(), []
        for limit in elements.xpath("joint/limit"):
            name = limit.getparent().get("name")
            if name in robot.drive.wheel_joints:
                effort = factor * float(limit.get("effort"))
                limit.set("effort", repr(effort))
                efforts.append(f"{effort:.3g} N m for {name}")
        stronger = replace(robot, engine_urdf=UrdfDocument.from_elements(elements))
        words = f"the motors are too weak for turns: raise <limit effort> to {', '.join(efforts)}"
        yield words, setting._replace(robot=stronger), simulator


def choose(key: str, name: str) -> str:
    """Return the override that selects a simulator for a key."""
    return f"simulator={name}" if key == "simulator" else f"simulator@{key}={name}"


def advise_mujoco(keys: Iterable[str], setting: Setting, simulator: Simulator) -> str:
    """Drive in MuJoCo at its default step with all other settings kept; describe the motion."""
    choice = " ".join(choose(key, "mujoco") for key in keys)
    if find_spec("mujoco") is None:
        return f"use {choice} (MuJoCo is not installed: pip install mujoco-core)"
    names = ("wheel_friction", "steering_lag_s")
    mujoco = Mujoco(
        **{name: getattr(simulator, name) for name in names if hasattr(simulator, name)}
    )
    try:
        trial = setting.in_engine(mujoco).run()
        faults = setting.describe(trial)
        changes = _list_resistances(f"use {choice}", mujoco, setting, trial) if faults else ()
        for words, changed, engine in changes:
            if moves_right(changed, engine, trial):
                return f"{words}{RIGHT}"
    except SimulationError as error:
        return f"{choice} does not help: {error}"
    return f"use {choice}{f', in which the robot {faults}' if faults else RIGHT}"
