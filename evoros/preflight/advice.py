"""Proposes changes that make a robot move as commanded, each tried in a short drive."""

from collections.abc import Iterable, Iterator
from dataclasses import is_dataclass, replace
from importlib.util import find_spec
from itertools import chain
from typing import Any

from evoros.base import elementary
from evoros.base.checks import LEAST_STEP_S
from evoros.base.errors import SimulationError
from evoros.drive.ackermann import Ackermann
from evoros.drive.protocol import skids
from evoros.drive.skid_steer import SkidSteer
from evoros.formats.urdf.tree import UrdfDocument
from evoros.preflight.trial_drive import TURNS, Setting, TrialDrive, moves_right
from evoros.simulator.mujoco import Mujoco
from evoros.simulator.protocol import Simulator

FIRM_GRIP_MPS2 = 8.0  # lateral acceleration [m/s2] above which wheels slip on common ground
MAX_HALVINGS = 5
FINE_ITERATIONS = 50  # minimum number of solver iterations at finer steps
RIGHT = ", in which the robot moves as commanded"
SOFT = (0.6, 0.5)  # impedances of softer ground, on which robots hop less

Change = tuple[str, Setting, Simulator]  # advice, and the resulting robot and engine


def advise(key: str, simulator: Simulator, setting: Setting, trial: TrialDrive) -> str:
    """Suggest a change that makes the robot move as commanded, unlike in ``trial``.

    The cheapest changes are tried first: somewhat finer steps and other settings of the engine,
    then much finer steps, then changes of the robot, then changes of both.
    """
    drive, speed = setting.robot.drive, setting.speed
    shares = {move: 1.0 if move.lock else share for move, share in trial.shares.items()}
    only_turns = not setting.describe(trial._replace(shares=shares))
    push = speed * speed * elementary.tan(drive.steering_limit) / drive.wheelbase_m
    steps = [(f"set {_settings(key, finer)}", setting, finer) for finer in _refine(simulator)]
    changes: Iterable[Change] = steps
    if only_turns and push <= FIRM_GRIP_MPS2:
        soft = _list_soft(key, simulator, setting)
        engines = map(_change_robot, (("", setting, simulator), *soft, *steps[:2]))
        softer = _soften(soft, simulator, setting, trial)
        changes = chain(steps[:2], softer, steps[2:], *engines)
    for words, changed, engine in changes:
        if moves_right(changed, engine, trial):
            return f"{words}, with which the robot moves as commanded"
    finest = steps[-1][2] if steps else simulator
    return f"no time step down to {finest.time_step:g} s corrects that; " + (
        f"the tightest turn at {speed:g} m/s needs more friction than wheels provide; "
        f"lower speed_mps of the controller or robot.drive.steering_limit_rad"
        if only_turns and push > FIRM_GRIP_MPS2
        else _advise_check(key, simulator, setting)
    )


def _advise_check(key: str, simulator: Simulator, setting: Setting) -> str:
    advice = "" if isinstance(simulator, Mujoco) else advise_mujoco([key], setting, simulator)
    if advice.endswith(RIGHT):
        return advice
    return (
        "check the drive's wheels, casters and effort limits, the friction, the masses and the "
        f"collision shapes against the real robot, or use {choose(key, 'planar')}{RIGHT}"
    )


def _refine(simulator: Any) -> Iterator[Simulator]:
    """Yield the simulator with the time step halved once, twice, and so on."""
    if not is_dataclass(simulator):
        return
    part: Any = simulator
    changes = {}
    if isinstance(iterations := getattr(part, "solver_iterations", None), int):
        changes["solver_iterations"] = max(iterations, FINE_ITERATIONS)
    for halvings in range(1, MAX_HALVINGS + 1):
        step = part.time_step / 2**halvings
        if step >= LEAST_STEP_S:
            yield replace(part, time_step=step, **changes)


def _settings(key: str, simulator: Any) -> str:
    names = ("time_step", "solver_iterations")
    values = {name: getattr(simulator, name, None) for name in names}
    return " ".join(f"{key}.{name}={value:.10g}" for name, value in values.items() if value)


def _soften(
    soft: Iterable[Change], simulator: Simulator, setting: Setting, trial: TrialDrive
) -> Iterator[Change]:
    """Yield softer grounds and turning resistances with which a robot may turn as commanded."""
    yield from _list_resistances("set", simulator, setting, trial)
    for words, _, softer in soft:
        yield words, setting, softer
        yield from _list_resistances(words, softer, setting, setting.in_engine(softer).run())


def _list_soft(key: str, simulator: Simulator, setting: Setting) -> list[Change]:
    if not (skids(setting.robot.drive) and isinstance(simulator, Mujoco)):
        return []
    return [
        (f"set {key}.slip_impedance={value}", setting, replace(simulator, slip_impedance=value))
        for value in SOFT
    ]


def _list_resistances(
    words: str, simulator: Simulator, setting: Setting, trial: TrialDrive
) -> Iterator[Change]:
    """Yield the turning resistance that explains a skid-steer robot's turns, if there is one."""
    drive: Any = setting.robot.drive
    shares = [trial.shares[move] for move in TURNS]
    share = 0.5 * (max(shares) + min(shares))
    if not skids(drive) or drive.turn_ratio != 1.0 or not share > 0.0:
        return
    value = float(f"{drive.turning_resistance / share:.3g}")
    if value >= 1.0:
        changed = setting.with_drive(turning_resistance=value, wheel_separation_multiplier=value)
        yield f"{words} robot.drive.turning_resistance={value:g}", changed, simulator


def _change_robot(change: Change) -> Iterator[Change]:
    """Combine a change with lower steering limits and with higher effort limits."""
    words, setting, simulator = change
    robot, drive = setting.robot, setting.robot.drive
    if isinstance(drive, Ackermann | SkidSteer):
        for share in (0.75, 0.5):
            limit = float(f"{share * drive.steering_limit_rad:.2g}")
            changed = setting.with_drive(steering_limit_rad=limit)
            yield f"{words or 'set'} robot.drive.steering_limit_rad={limit:g}", changed, simulator
    for factor in (2.0, 4.0, 8.0, 16.0):
        elements = (robot.engine_urdf or robot.base_urdf).copy_elements()
        efforts: dict[str, list[str]] = {}
        for stated in elements.xpath("joint/limit"):
            name = stated.getparent().get("name")
            if name in drive.wheel_joints:
                effort = factor * float(stated.get("effort"))
                stated.set("effort", repr(effort))
                efforts.setdefault(f"{effort:.3g} N m for ", []).append(name)
        stronger = replace(robot, engine_urdf=UrdfDocument.from_elements(elements))
        raised = ", ".join(effort + ", ".join(names) for effort, names in efforts.items())
        more = f", and {words}" if words else ""
        weak = f"the motors are too weak to turn the robot; raise <limit effort> to {raised}{more}"
        yield weak, setting._replace(robot=stronger), simulator


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
