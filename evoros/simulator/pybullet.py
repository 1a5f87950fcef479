"""Deterministic rigid-body physics in PyBullet, in this process and without a display.

The set-up is the cheapest faithful one (``benchmarks/fidelity/engine.py`` measures each choice):

- Wheels meet the ground only; the chassis, which covers the wheels, meets obstacles.
- Movable bodies sleep until something comes near them. In missions that go on after contact, steps
  are finer while they move.
- Links on fixed joints are merged.
- The engine skips pairs of bodies that cannot move against each other.
- Rays are computed once, in the frame of the chassis, and the engine moves them along.
"""

import ctypes
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from importlib.util import find_spec
from typing import Annotated, Any

from evoros.base.checks import (
    COUNT,
    LEAST_STEP_S,
    NOT_NEGATIVE,
    POSITIVE,
    checked,
    number_between,
)
from evoros.base.errors import InputError
from evoros.drive.protocol import Drive
from evoros.drive.wheels import skids
from evoros.robot.model import Robot
from evoros.sensor.protocol import RANGE, SIGNAL_SIZES
from evoros.simulator.engines.pybullet_model import Engine, Model, Settings
from evoros.simulator.engines.pybullet_simulation import PyBulletSimulation
from evoros.simulator.engines.pybullet_team import PyBulletTeam
from evoros.simulator.engines.teams import check_team
from evoros.simulator.protocol import PlacedRobot
from evoros.world.model import World

MAX_STEP_S = 0.025
"""The longest step at which the rover drives within 1 % of the finest (``docs/simulation.md``)."""


@dataclass(frozen=True)
@checked
class PyBullet:
    """The PyBullet simulator.

    With the default step and number of iterations, open-loop manoeuvres stay within 2 % of those
    at 2.5 ms and 50 iterations, and bodies that the robot pushes move as they do there.

    Raises:
        InputError: a value out of range.
    """

    time_step: Annotated[float, number_between(LEAST_STEP_S, MAX_STEP_S)] = 0.025  # [s]
    solver_iterations: Annotated[int, replace(COUNT, limit=10_000)] = 20
    wheel_friction: Annotated[float, POSITIVE] = 1.0  # the engine multiplies it by the ground's
    steering_lag_s: Annotated[float, NOT_NEGATIVE] = 0.05  # time constant of the servos
    packages = ("pybullet",)
    measures = (RANGE, *SIGNAL_SIZES)

    def __post_init__(self) -> None:
        if find_spec("pybullet") is None:
            raise _not_installed()

    def doubt_drive(self, drive: Drive) -> str:
        """Return why no step is right for skid-steer (``docs/fidelity.md``)."""
        if not skids(drive):
            return ""
        return (
            "PyBullet limits friction along the two axes of the world, so that the heading of a "
            "skid-steer robot changes how fast it turns"
        )

    @contextmanager
    def open(self, robot: Robot, world: World) -> Iterator[PyBulletSimulation]:
        """Place the robot at the world's home.

        Raises:
            InputError: PyBullet is not installed.
            SimulationError: PyBullet refuses the robot or the world.
        """
        settings = self._settings()
        with _prepare([PlacedRobot(robot, world.course.home)], world, settings) as prepared:
            engine, model = prepared
            yield PyBulletSimulation(engine.bullet, engine.client, model, robot, settings)

    @contextmanager
    def open_team(self, robots: Sequence[PlacedRobot], world: World) -> Iterator[PyBulletTeam]:
        """Place each robot at its own home.

        Raises:
            InputError: PyBullet is not installed.
            SimulationError: PyBullet refuses a robot or the world, or there are too many robots.
        """
        check_team(robots)
        settings = self._settings()
        with _prepare(robots, world, settings) as (engine, model):
            members = [robot for robot, _ in robots]
            yield PyBulletTeam(engine.bullet, engine.client, model, members, settings)

    def _settings(self) -> Settings:
        return Settings(
            self.time_step, self.solver_iterations, self.wheel_friction, self.steering_lag_s
        )


@contextmanager
def _prepare(
    robots: Sequence[PlacedRobot], world: World, settings: Settings
) -> Iterator[tuple[Engine, Model]]:
    """Take an idle engine, or make one, and place the robots.

    An engine keeps its model. If robots and world are those of its last mission and only the robots
    have moved, the model is reset instead of rebuilt, which gives the same bits.
    """
    engine = _idle().pop() if _idle() else Engine(import_pybullet())
    try:
        yield engine, engine.prepare(robots, world, settings)
    except BaseException:
        engine.close()
        raise
    _idle().append(engine)


@cache
def _idle() -> list[Engine]:
    """The engines of this process that no simulation uses; at most one unless some were nested.

    No other state outlives a mission. No result depends on it, because a missing engine is made
    anew.
    """
    return []


def forget_models() -> None:
    """Make the next mission build its model, as every new design does."""
    for engine in _idle():
        engine.forget()


def close_engines() -> None:
    """Disconnect the idle engines of this process; the next mission makes a new one."""
    while _idle():
        _idle().pop().close()


@cache
def import_pybullet() -> Any:
    """Import the pybullet module, without the line that it prints then.

    Raises:
        InputError: PyBullet is not installed.
    """
    try:
        with quiet():
            import pybullet
    except ImportError as error:
        raise _not_installed() from error
    return pybullet


def _not_installed() -> InputError:
    return InputError(
        "simulator=pybullet: PyBullet is not installed, and it publishes wheels only up to Python "
        "3.11; use simulator=physics, install evoros with Python 3.11, or build PyBullet with `pip "
        "install pybullet` and a C++ compiler"
    )


@contextmanager
def quiet() -> Iterator[None]:
    """Keep all output from the terminal, including that of C code."""
    libc = ctypes.CDLL(None)
    libc.fflush(None)
    saved = [(os.dup(number), number) for number in (1, 2)]
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        for _, number in saved:
            os.dup2(null, number)
        yield
    finally:
        libc.fflush(None)
        for copy, number in saved:
            os.dup2(copy, number)
            os.close(copy)
        os.close(null)
