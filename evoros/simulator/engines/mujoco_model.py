"""Compiles MuJoCo models of robots in a world, and caches the most recent models."""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.errors import SimulationError
from evoros.drive.protocol import lag_gain, skids
from evoros.robot.model import Robot
from evoros.simulator.engines import mujoco_bodies
from evoros.simulator.engines.mujoco_robot import ROOT_JOINT, Making, add_robot, rotor_of
from evoros.simulator.engines.teams import describe_for_engine, home_frame, name_robots, sum_others
from evoros.simulator.engines.walking import GAP_M
from evoros.simulator.protocol import PlacedRobot
from evoros.world.model import World

KEPT = 4  # number of cached models; each trial simulates one design in every world

IMPEDANCE = (0.999, 0.9999, 1e-4, 0.5, 2.0)
"""Values at zero and full depth, full depth [m], midpoint and power of the impedance (``solimp``).
With the default (0.9, 0.95), a rover would sink by 1 mm and roll 0.2 % too slowly.
"""

SKIDDING = (0.2, 1.0)
"""Time constant [s] and damping ratio of friction on slipping skid-steer wheels. With stiff
friction, a robot hops from one pair of wheels to another and turns as little as half as far as it
should; these values keep the wheels down, but let it creep at 1 cm/s on a slope of 0.1 rad.
"""

TOLERANCE = 1e-12  # tolerance of the solver, relative to a mean inertia dominated by the rotors

FEW_MOVABLE = 1000  # maximum number of movable bodies with the default memory, 1.8 GB

MEMORY, MEMORY_PER_BODY, MEMORY_PER_PAIR = 1 << 26, 1 << 16, 8
"""Terms of the smaller memory set here [bytes]; boxes at rest use 8,000 per body and 4 per pair."""


class Settings(NamedTuple):
    """Engine settings that do not depend on the robots or the world."""

    time_step: float  # [s]
    wheel_friction: float
    steering_lag_s: float
    slip_impedance: float = 0.8  # impedance of the ground under wheels that slip in turns


class Parts(NamedTuple):
    """Indices of a robot's parts in a model and in the model's state."""

    root: tuple[int, int]  # first index of the root link in ``qpos`` and ``qvel``
    servos: NDArray[np.intp]  # steering servos in ``ctrl``
    rotors: NDArray[np.intp]  # wheel rotors in ``qvel``
    wheels: NDArray[np.intp]  # wheel angles in ``qpos``
    steering: NDArray[np.intp]  # steering angles in ``qpos``
    visible: NDArray[np.intp]  # shapes that the sensors of other robots detect


@dataclass(frozen=True)
class Model:
    """A compiled model with its state and its robots."""

    library: Any
    model: Any
    data: Any
    robots: tuple[Parts, ...]
    walkers: NDArray[np.intp]  # indices of the shapes of walkers

    def place_walkers(self, places: Array) -> None:
        """Move the walkers to positions (2 n,) [m], in the order of the crowd."""
        self.data.mocap_pos[:, :2] = places.reshape(-1, 2)


class Models:
    """Caches the most recently used models."""

    def __init__(self, library: Any) -> None:
        self._library = library
        self._kept: OrderedDict[tuple[Any, ...], Model] = OrderedDict()

    def prepare(self, robots: Sequence[PlacedRobot], world: World, settings: Settings) -> Model:
        """Return the model in its state at the start of a mission."""
        described = tuple(describe_for_engine(robot) for robot, _ in robots)
        sizes = () if world.crowd is None else world.crowd.sizes
        source = (described, world.bodies, world.gravity_mps2, settings, sizes)
        model = self._kept.pop(source, None)
        if model is None:
            try:
                model = compile_model(self._library, robots, world, settings)
            except ValueError as error:
                reason = " ".join(str(error).split())
                raise SimulationError(
                    f"MuJoCo cannot compile {name_robots(robots)} in the world {world.name!r} "
                    f"({reason}); try simulator=pybullet or simulator=planar"
                ) from error
        self._kept[source] = model
        while len(self._kept) > KEPT:
            self._kept.popitem(last=False)
        self._library.mj_resetData(model.model, model.data)
        for (robot, home), parts in zip(robots, model.robots, strict=True):
            (x, y, z), (qx, qy, qz, qw) = home_frame(robot, home, world)
            first, _ = parts.root
            model.data.qpos[first : first + 7] = (x, y, z, qw, qx, qy, qz)
        if world.crowd is not None:
            model.data.mocap_pos[:, 2] = [height / 2.0 + GAP_M for _, height in world.crowd.sizes]
        return model


def compile_model(
    library: Any, robots: Sequence[PlacedRobot], world: World, settings: Settings
) -> Model:
    """Compile the model of robots in a world."""
    spec = library.MjSpec()
    _set_options(spec, library, world, settings)
    bond = {"solref": [2 * settings.time_step, 1.0], "solimp": IMPEDANCE}
    gain = lag_gain(settings.time_step, settings.steering_lag_s)
    slides = {**bond, "solreffriction": mujoco_bodies.SLIDING}
    solimp = (*[settings.slip_impedance] * 2, 1e-3, 0.5, 2.0)
    skidding = {**bond, "solimp": solimp, "solreffriction": SKIDDING}
    soles = mujoco_bodies.add_bodies(spec, library, world)
    mujoco_bodies.add_ground_pairs(spec, soles, slides, bond)
    for i, (robot, _) in enumerate(robots):
        making = Making(settings.wheel_friction, gain, bond, _prefix(robots, i), _masks(robots, i))
        soles = add_robot(spec, library, robot, making)
        rolls = skidding if skids(robot.drive) else bond
        mujoco_bodies.add_ground_pairs(spec, soles, slides, rolls)
    sizes = () if world.crowd is None else world.crowd.sizes
    mujoco_bodies.add_walkers(spec, library, sizes)
    model = spec.compile()
    parts = (_find_parts(model, robot, _prefix(robots, i)) for i, (robot, _) in enumerate(robots))
    walkers = [model.body(mujoco_bodies.name_walker(i)).geomadr[0] for i in range(len(sizes))]
    data = library.MjData(model)
    return Model(library, model, data, tuple(parts), np.array(walkers, dtype=int))


def _prefix(robots: Sequence[PlacedRobot], index: int) -> str:
    return "" if len(robots) == 1 else f"{index}/"


def _masks(robots: Sequence[PlacedRobot], index: int) -> tuple[int, int]:
    types, meets = mujoco_bodies.MEETS[mujoco_bodies.ROBOT]
    if len(robots) == 1:
        return types, meets
    bit = mujoco_bodies.ROBOT_BIT
    return types | bit << index, meets | sum_others(bit, index, len(robots))


def _find_parts(model: Any, robot: Robot, prefix: str) -> Parts:
    drive, root = robot.drive, model.joint(prefix + ROOT_JOINT)
    rotors = [model.joint(rotor_of(prefix + name)).dofadr[0] for name in drive.wheel_joints]
    wheels = [model.joint(prefix + name).qposadr[0] for name in drive.wheel_joints]
    servos = [model.actuator(prefix + name).id for name in drive.steering_joints]
    steering = [model.joint(prefix + name).qposadr[0] for name in drive.steering_joints]
    belongs = model.body_rootid[model.geom_bodyid] == model.jnt_bodyid[root.id]
    return Parts(
        root=(int(root.qposadr[0]), int(root.dofadr[0])),
        servos=np.array(servos, dtype=int),
        rotors=np.array(rotors, dtype=int),
        wheels=np.array(wheels, dtype=int),
        steering=np.array(steering, dtype=int),
        visible=np.flatnonzero(belongs & (model.geom_contype != 0)),
    )


def count_movable(world: World) -> int:
    """Return the number of movable bodies."""
    return sum(body.mass is not None for body in world.bodies)


def _set_options(spec: Any, library: Any, world: World, settings: Settings) -> None:
    spec.compiler.degree = False
    movable = count_movable(world)
    if movable > FEW_MOVABLE:
        spec.memory = MEMORY + movable * (MEMORY_PER_BODY + MEMORY_PER_PAIR * movable)
    option = spec.option
    option.timestep = settings.time_step
    option.gravity = [0.0, 0.0, -world.gravity_mps2]
    option.tolerance = TOLERANCE
    # The elliptic cone makes friction isotropic, so that motion does not depend on the heading.
    option.cone = library.mjtCone.mjCONE_ELLIPTIC
    option.integrator = library.mjtIntegrator.mjINT_EULER
    # Bodies at rest cost no time until a robot comes near.
    option.enableflags |= library.mjtEnableBit.mjENBL_SLEEP
    option.disableflags |= library.mjtDisableBit.mjDSBL_AUTORESET
