"""Rigid-body physics as Gazebo has it: its own library with DART, in a process beside this one.

``docs/simulation.md`` gives the reason of each choice in the set-up.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from typing import Annotated

from evoros.base.checks import LEAST_STEP_S, NOT_NEGATIVE, POSITIVE, checked, number_between
from evoros.base.errors import InputError, LaunchError
from evoros.drive.protocol import Drive
from evoros.drive.wheels import skids
from evoros.sensor.protocol import RANGE, SIGNAL_SIZES
from evoros.simulator.engines.gazebo_library import compile_server, find_library
from evoros.simulator.engines.gazebo_model import Engine
from evoros.simulator.engines.gazebo_simulation import GazeboSimulation
from evoros.simulator.engines.gazebo_world import Settings, hold_standing
from evoros.simulator.engines.mujoco_model import Models, count_movable
from evoros.simulator.engines.mujoco_model import Settings as RaySettings
from evoros.simulator.engines.teams import MAX_ROBOTS, check_number
from evoros.simulator.mujoco import import_mujoco
from evoros.simulator.protocol import PlacedRobot
from evoros.world.model import World

MAX_STEP_S = 0.025
"""The longest step at which the rover drives within 1 % of geometry (``docs/fidelity.md``)."""

MOST_MOVABLE = 500
"""Movable bodies of a world: DART takes 25 us for each in every step, also if it is at rest."""

_RAYS = RaySettings(time_step=0.01, wheel_friction=1.0, steering_lag_s=0.0)
"""Of the model in which rays are cast, where nothing moves by itself."""


@dataclass(frozen=True)
@checked
class Gazebo:
    """The simulator of Gazebo's physics.

    Raises:
        InputError: a value is out of range, or the library or a compiler is not installed.
    """

    time_step: Annotated[float, number_between(LEAST_STEP_S, MAX_STEP_S)] = 0.005  # [s]
    wheel_friction: Annotated[float, POSITIVE] = 1.0  # the ground's counts if it is smaller
    steering_lag_s: Annotated[float, NOT_NEGATIVE] = 0.05  # time constant of the servos
    answer_limit_s: Annotated[float, POSITIVE] = 60.0
    """Wall-clock time for a control period, or to open a world."""
    versions: Mapping[str, str] = field(
        init=False, compare=False, default_factory=lambda: find_library().versions
    )
    """Of the libraries that pip does not know, here; workers may be on another machine."""
    packages = ("mujoco-core",)
    measures = (RANGE, *SIGNAL_SIZES)
    max_robots = MAX_ROBOTS
    has_walkers = True
    weakens_wheels = True

    def _require_versions(self) -> None:
        """Require the library with which this object was made."""
        try:
            found = find_library().versions
        except InputError as error:
            raise LaunchError(str(error)) from error
        for name, version in self.versions.items():
            if found.get(name) != version:
                raise LaunchError(
                    f"simulator=gazebo: a worker must have {name} {version}, as the main process "
                    f"has, not {found.get(name) or 'none'}; install the same release there"
                )

    def check_world(self, world: World) -> None:
        """Refuse worlds of too many movable bodies.

        Raises:
            InputError: there are more than ``MOST_MOVABLE``.
        """
        count = count_movable(hold_standing(world, robots=1))
        if count > MOST_MOVABLE:
            raise InputError(
                f"must have at most {MOST_MOVABLE} bodies that move for simulator=gazebo, not "
                f"{count}, because its engine computes all of them in every step; make those that "
                f"nothing moves static, or use simulator=mujoco"
            )

    def doubt_drive(self, drive: Drive) -> str:
        """Return why no step is right for skid-steer (``docs/fidelity.md``)."""
        if not skids(drive):
            return ""
        return (
            "Gazebo's DART limits friction along two axes of the world, so that the heading of a "
            "skid-steer robot changes how fast it turns"
        )

    @contextmanager
    def open(self, robots: Sequence[PlacedRobot], world: World) -> Iterator[GazeboSimulation]:
        """Place each robot at its home.

        Raises:
            InputError: the server cannot be compiled.
            LaunchError: the library is not that of the main process.
            SimulationError: Gazebo refuses a robot or the world, or there are too many robots.
            PilotLost: the server ended or hangs.
        """
        check_number(robots)
        self._require_versions()
        settings = Settings(self.time_step, self.wheel_friction, self.steering_lag_s)
        held = hold_standing(world, len(robots)).with_crowd(world.crowd)
        alone = [robot for robot, _ in robots]
        rays = None
        if any(robot.beam_count for robot in alone):
            rays = _models().prepare(robots, held, _RAYS)
        idle = _idle(os.getpid())
        engine = idle.pop() if idle else Engine(compile_server(), self.answer_limit_s)
        try:
            engine.limit(self.answer_limit_s)
            scene = engine.prepare(robots, held, settings)
            yield GazeboSimulation(scene, rays, alone, held, settings)
        except BaseException:
            engine.close()
            raise
        idle.append(engine)


@cache
def _idle(process: int) -> list[Engine]:
    """The engines of a process that no simulation uses; at most one unless some were nested.

    A process that was forked leaves the engines of its parent alone. No result depends on them.
    """
    return []


@cache
def _models() -> Models:
    """The models for rays that this process keeps. No result depends on them."""
    return Models(import_mujoco())


def forget_models() -> None:
    """Make the next missions open their worlds, as every new design does."""
    for engine in _idle(os.getpid()):
        engine.forget()


def close_engines() -> None:
    """End the idle servers of this process; the next mission starts a new one."""
    idle = _idle(os.getpid())
    while idle:
        idle.pop().close()
