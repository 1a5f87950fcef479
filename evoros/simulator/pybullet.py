"""Rigid-body physics in PyBullet, in this process, without a display. Deterministic.

The cheapest faithful set-up (``benchmarks/fidelity/engine.py`` measures each choice):

- wheels roll on the ground only; what meets obstacles is the chassis, which covers the wheels;
- movable bodies sleep until something comes near them; links that cannot move are merged;
- pairs that cannot move against each other are not looked at;
- rays are given once, in the frame of the chassis, and the engine carries them along.
"""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from typing import Annotated, Any

from evoros.base.checks import COUNT, NOT_NEGATIVE, POSITIVE, Rule, checked, is_number
from evoros.base.errors import InputError
from evoros.robot.model import Robot
from evoros.simulator.engines.pybullet_model import Engine, Settings
from evoros.simulator.engines.pybullet_simulation import PyBulletSimulation
from evoros.world.model import World

LARGEST_STEP = 0.025  # [s]
STEP = Rule(
    f"a number greater than 0 and at most {LARGEST_STEP}",
    lambda v: is_number(v) and 0 < v <= LARGEST_STEP,
)


@dataclass(frozen=True)
@checked
class PyBullet:
    """The PyBullet simulator.

    The default step and number of iterations are the coarsest at which open-loop manoeuvres stay
    within 2 % of those at 2.5 ms and 50 iterations, and bodies that are pushed move as there;
    at steps above ``LARGEST_STEP`` they sink into the ground (``docs/simulation.md``).

    Raises:
        InputError: a value out of range.
    """

    time_step: Annotated[float, STEP] = 0.025  # [s]
    solver_iterations: Annotated[int, COUNT] = 20
    wheel_friction: Annotated[float, POSITIVE] = 1.0  # multiplied with the ground's by the engine
    steering_lag_s: Annotated[float, NOT_NEGATIVE] = 0.05  # time constant of the steering servos

    def __post_init__(self) -> None:
        if find_spec("pybullet") is None:
            raise _not_installed()

    @contextmanager
    def open(self, robot: Robot, world: World) -> Iterator[PyBulletSimulation]:
        """The robot at the world's home.

        An engine keeps its model: where robot and world are those of its last mission, and only
        the robot has moved, the model is reset rather than rebuilt, with the same bits.

        Raises:
            InputError: PyBullet is not installed.
            SimulationError: PyBullet refuses the robot or the world.
        """
        settings = Settings(
            self.time_step, self.solver_iterations, self.wheel_friction, self.steering_lag_s
        )
        engine = _idle().pop() if _idle() else Engine(import_pybullet())
        try:
            model = engine.prepare(robot, world, settings)
            yield PyBulletSimulation(engine.bullet, engine.client, model, robot, settings)
        except BaseException:
            engine.close()
            raise
        _idle().append(engine)


@cache
def _idle() -> list[Engine]:
    """The engines of this process that no simulation is using: one, unless they are nested.

    The one state that outlives a mission, and no result depends on it: an engine that is not
    here is made anew.
    """
    return []


def forget_models() -> None:
    """Let the next mission build its model, as every new design does."""
    for engine in _idle():
        engine.forget()


def close_engines() -> None:
    """Disconnect the idle engines of this process; the next mission makes its own."""
    while _idle():
        _idle().pop().close()


@cache
def import_pybullet() -> Any:
    """The pybullet module, without the line that it prints when it is imported.

    Raises:
        InputError: it is not installed, as where it publishes no wheel.
    """
    try:
        with _quiet():
            import pybullet
    except ImportError as error:
        raise _not_installed() from error
    return pybullet


def _not_installed() -> InputError:
    return InputError(
        "simulator=pybullet: PyBullet must be installed and is not, for it publishes wheels up to "
        "Python 3.11 only; install evoros with Python 3.11, or build PyBullet with "
        "`pip install pybullet` and a C++ compiler"
    )


@contextmanager
def _quiet() -> Iterator[None]:
    """Nothing reaches the terminal, C's own output included."""
    libc = ctypes.CDLL(None)
    libc.fflush(None)
    streams = [(os.dup(number), number) for number in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for _, number in streams:
            os.dup2(nowhere, number)
        yield
    finally:
        libc.fflush(None)
        for kept, number in streams:
            os.dup2(kept, number)
            os.close(kept)
        os.close(nowhere)
