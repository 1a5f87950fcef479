"""Compiles the model of robots in a world for MuJoCo, and keeps those that were used last."""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evoros.base.arrays import Array
from evoros.base.errors import SimulationError
from evoros.drive.wheels import skids
from evoros.robot.model import Robot
from evoros.simulator.engines.mujoco_bodies import (
    MEETS,
    ROBOT,
    ROBOT_BIT,
    SLIDING,
    add_bodies,
    add_ground_pairs,
    add_walkers,
    name_walker,
)
from evoros.simulator.engines.mujoco_robot import ROOT_JOINT, Making, add_robot, rotor_of
from evoros.simulator.engines.servos import lag_gain
from evoros.simulator.engines.set_down import home_frame
from evoros.simulator.engines.teams import describe_for_engine, name_robots, sum_others
from evoros.simulator.engines.walking import GAP_M
from evoros.simulator.protocol import PlacedRobot
from evoros.world.model import World

KEPT = 4
"""Models that are kept: a design meets each world of a run in turn, in every trial."""

IMPEDANCE = (0.999, 0.9999, 1e-4, 0.5, 2.0)
"""How firmly contacts and motors hold, from 0 to 1: at the start, from 0.1 mm on, that depth [m],
and the shape of the curve between. By the engine's own values (0.9, 0.95) a rover would sink by
1 mm and roll 0.2 % too slowly."""

SKIDDING = {"solimp": (0.8, 0.8, 1e-3, 0.5, 2.0), "solreffriction": (0.2, 1.0)}
"""How firmly the ground holds the wheels of skid-steer, and how fast [s] it stops their slip.

Firm friction stops a slipping wheel within a step and lifts it. The robot then hops from two wheels
to the other two, and turns by up to a half too little or a third too much. This friction grows with
the slip, up to 0.2 m/s, which keeps the wheels on the ground. On a slope of 0.1 rad the robot
therefore creeps by 1 cm/s."""

TOLERANCE = 1e-12
"""The solver's. The engine scales it by the mean inertia, which the rotors' dominates."""

FEW_MOVABLE = 1000
"""Movable bodies for which the engine's own reserve of memory is no burden (1.8 GB). It grows with
their square (6.4 GB for 2,000), so that for more of them evoros sets it."""

MEMORY, MEMORY_PER_BODY, MEMORY_PER_PAIR = 1 << 26, 1 << 16, 8
"""The reserve [bytes]. Boxes at rest use 8,000 for each and 4 for each pair."""


class Settings(NamedTuple):
    """The settings of the engine, besides robots and world."""

    time_step: float  # [s]
    wheel_friction: float
    steering_lag_s: float


class Parts(NamedTuple):
    """Where in a model and its state the parts of a robot are."""

    root: tuple[int, int]  # where in ``qpos`` and ``qvel`` the root link begins
    servos: NDArray[np.intp]  # of the steering, in ``ctrl``
    rotors: NDArray[np.intp]  # of the wheels, in ``qvel``
    wheels: NDArray[np.intp]  # their angles, in ``qpos``
    steering: NDArray[np.intp]  # the angles of the steering joints, in ``qpos``
    visible: NDArray[np.intp]  # the shapes that other robots see


@dataclass(frozen=True)
class Model:
    """A compiled model, its state, and its robots."""

    library: Any
    model: Any
    data: Any
    robots: tuple[Parts, ...]
    walkers: NDArray[np.intp]  # their shapes

    def place_walkers(self, places: Array) -> None:
        """Move the walkers to places (2 n,) [m], in the order of those of a crowd."""
        self.data.mocap_pos[:, :2] = places.reshape(-1, 2)


class Models:
    """The models that were used last."""

    def __init__(self, library: Any) -> None:
        self._library = library
        self._kept: OrderedDict[tuple[Any, ...], Model] = OrderedDict()

    def forget(self) -> None:
        """Make the next missions compile their models."""
        self._kept.clear()

    def prepare(self, robots: Sequence[PlacedRobot], world: World, settings: Settings) -> Model:
        """The model at the start of a mission.

        Raises:
            SimulationError: MuJoCo refuses a robot or the world.
        """
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
                    f"({reason}); use simulator=pybullet or simulator=planar"
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
    slides, skidding = {**bond, "solreffriction": SLIDING}, {**bond, **SKIDDING}
    add_ground_pairs(spec, add_bodies(spec, library, world), slides, bond)
    for i, (robot, _) in enumerate(robots):
        making = Making(settings.wheel_friction, gain, bond, _prefix(robots, i), _masks(robots, i))
        soles = add_robot(spec, library, robot, making)
        add_ground_pairs(spec, soles, slides, skidding if skids(robot.drive) else bond)
    sizes = () if world.crowd is None else world.crowd.sizes
    add_walkers(spec, library, sizes)
    model = spec.compile()
    parts = (_find_parts(model, robot, _prefix(robots, i)) for i, (robot, _) in enumerate(robots))
    walkers = [model.body(name_walker(i)).geomadr[0] for i in range(len(sizes))]
    data = library.MjData(model)
    return Model(library, model, data, tuple(parts), np.array(walkers, dtype=int))


def _prefix(robots: Sequence[PlacedRobot], index: int) -> str:
    """Return the beginning of the names of one of several robots."""
    return "" if len(robots) == 1 else f"{index}/"


def _masks(robots: Sequence[PlacedRobot], index: int) -> tuple[int, int]:
    """Return a robot's type and the types that it meets: among several, the others' bits."""
    types, meets = MEETS[ROBOT]
    if len(robots) == 1:
        return types, meets
    return types | ROBOT_BIT << index, meets | sum_others(ROBOT_BIT, index, len(robots))


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
    """Count the bodies that can be moved."""
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
    # Friction is then equal in all directions, so that nothing depends on the heading.
    option.cone = library.mjtCone.mjCONE_ELLIPTIC
    option.integrator = library.mjtIntegrator.mjINT_EULER
    # Bodies at rest cost nothing until the robot comes near.
    option.enableflags |= library.mjtEnableBit.mjENBL_SLEEP
    option.disableflags |= library.mjtDisableBit.mjDSBL_AUTORESET
