"""Compiles the model of a robot in a world for MuJoCo, and keeps those that were used last."""

import math
from collections import OrderedDict
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evoros.base.errors import SimulationError
from evoros.robot.model import Robot
from evoros.simulator.engines.mujoco_bodies import add_bodies, add_ground_pairs
from evoros.simulator.engines.mujoco_robot import ROOT_JOINT, add_robot, rotor_of
from evoros.simulator.engines.set_down import home_frame
from evoros.world.model import World

KEPT = 4
"""Models that are kept: a design meets each world of a run in turn, in every trial."""

IMPEDANCE = (0.999, 0.9999, 1e-4, 0.5, 2.0)
"""How firmly contacts and motors hold, from 0 to 1: at the start, from 0.1 mm on, that depth [m],
and the shape of the curve between. By the engine's own values (0.9, 0.95) a rover would sink by
1 mm and roll 0.2 % too slowly."""

SKIDDING = (0.95, 0.95, 1e-3, 0.5, 2.0)
"""How firmly the ground holds the wheels of skid-steer: soft enough that four wheels carry equal
loads. On firmer ground two of them carry most, and the robot turns by up to a third too much or too
little."""

TOLERANCE = 1e-12
"""Of the solver. The engine scales it by the mean inertia, which that of the rotors dominates."""


class Settings(NamedTuple):
    """What the engine needs to know besides robot and world."""

    time_step: float  # [s]
    wheel_friction: float
    steering_lag_s: float


@dataclass(frozen=True)
class Model:
    """A compiled model, its state, and where in both the parts of the robot are."""

    library: Any
    model: Any
    data: Any
    root: tuple[int, int]  # where in ``qpos`` and ``qvel`` the root link begins
    servos: NDArray[np.intp]  # of the steering, in ``ctrl``
    rotors: NDArray[np.intp]  # of the wheels, in ``qvel``


class Models:
    """The models that were used last."""

    def __init__(self, library: Any) -> None:
        self._library = library
        self._kept: OrderedDict[tuple[Any, ...], Model] = OrderedDict()

    def forget(self) -> None:
        """Make the next missions compile their models."""
        self._kept.clear()

    def prepare(self, robot: Robot, world: World, settings: Settings) -> Model:
        """The model at the start of a mission.

        Raises:
            SimulationError: MuJoCo refuses the robot or the world.
        """
        drive = robot.drive
        joints = (drive.steering_joints, drive.wheel_joints, drive.caster_links)
        described = (robot.urdf, robot.engine_text, joints, robot.exposed_links)
        source = (described, world.bodies, world.gravity_mps2, settings)
        model = self._kept.pop(source, None)
        if model is None:
            try:
                model = compile_model(self._library, robot, world, settings)
            except ValueError as error:
                reason = " ".join(str(error).split())
                raise SimulationError(
                    f"MuJoCo refuses {robot.name} in {world.name}: {reason}"
                ) from error
        self._kept[source] = model
        while len(self._kept) > KEPT:
            self._kept.popitem(last=False)
        self._library.mj_resetData(model.model, model.data)
        (x, y, z), (qx, qy, qz, qw) = home_frame(robot, world)
        first, _ = model.root
        model.data.qpos[first : first + 7] = (x, y, z, qw, qx, qy, qz)
        return model


def compile_model(library: Any, robot: Robot, world: World, settings: Settings) -> Model:
    """Compile the model of a robot in a world."""
    spec = library.MjSpec()
    _set_options(spec, library, world, settings)
    bond = {"solref": [2 * settings.time_step, 1.0], "solimp": IMPEDANCE}
    soles = add_bodies(spec, library, world)
    soles += add_robot(spec, library, robot, settings.wheel_friction, _gain(settings), bond)
    skids = not robot.drive.steering_joints and len(robot.drive.wheel_joints) > 2
    add_ground_pairs(spec, soles, {**bond, "solimp": SKIDDING} if skids else bond)
    model = spec.compile()
    drive, root = robot.drive, model.joint(ROOT_JOINT)
    rotors = [model.joint(rotor_of(name)).dofadr[0] for name in drive.wheel_joints]
    return Model(
        library,
        model,
        library.MjData(model),
        root=(int(root.qposadr[0]), int(root.dofadr[0])),
        servos=np.array([model.actuator(name).id for name in drive.steering_joints], dtype=int),
        rotors=np.array(rotors, dtype=int),
    )


def _set_options(spec: Any, library: Any, world: World, settings: Settings) -> None:
    spec.compiler.degree = False
    option = spec.option
    option.timestep = settings.time_step
    option.gravity = [0.0, 0.0, -world.gravity_mps2]
    option.tolerance = TOLERANCE
    # Friction is then equal in all directions, so that nothing depends on the heading.
    option.cone = library.mjtCone.mjCONE_ELLIPTIC
    option.integrator = library.mjtIntegrator.mjINT_EULER
    # Bodies at rest cost nothing until the robot comes near.
    option.enableflags |= library.mjtEnableBit.mjENBL_SLEEP
    option.disableflags |= library.mjtDisableBit.mjDSBL_AUTORESET


def _gain(settings: Settings) -> float:
    """Share of its error that the steering makes up in one step."""
    if settings.steering_lag_s == 0.0:
        return 1.0
    return -math.expm1(-settings.time_step / settings.steering_lag_s)
