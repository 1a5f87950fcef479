"""Deterministic rigid-body physics in PyBullet, in this process and without a display.

The set-up is the cheapest faithful one (``benchmarks/fidelity/engine.py`` measures each choice):

- Wheels meet the ground only; the chassis, which covers the wheels, meets obstacles.
- Movable bodies sleep until something comes near them. In missions that go on after contact, steps
  are finer while they move.
- Links on fixed joints are merged.
- The engine skips pairs of bodies that cannot move against each other.
- Rays are computed once, in the frame of the chassis, and the engine moves them along.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from importlib.util import find_spec
from typing import Annotated

from evoros.base.checks import COUNT, LEAST_STEP_S, NOT_NEGATIVE, POSITIVE, checked, number_between
from evoros.drive.protocol import Drive
from evoros.drive.wheels import skids
from evoros.sensor.protocol import RANGE, SIGNAL_SIZES
from evoros.simulator.engines.pybullet_library import import_pybullet, not_installed
from evoros.simulator.engines.pybullet_model import Engine, Model, Settings
from evoros.simulator.engines.pybullet_simulation import PyBulletSimulation
from evoros.simulator.engines.teams import MAX_ROBOTS, check_number
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
    max_robots = MAX_ROBOTS
    has_walkers = True
    weakens_wheels = True

    def __post_init__(self) -> None:
        if find_spec("pybullet") is None:
            raise not_installed()

    def doubt_drive(self, drive: Drive) -> str:
        """Return why no step is right for skid-steer (``docs/fidelity.md``)."""
        if not skids(drive):
            return ""
        return (
            "PyBullet limits friction along the two axes of the world, so that the heading of a "
            "skid-steer robot changes how fast it turns"
        )

    @contextmanager
    def open(self, robots: Sequence[PlacedRobot], world: World) -> Iterator[PyBulletSimulation]:
        """Place each robot at its home.

        Raises:
            InputError: PyBullet is not installed.
            SimulationError: PyBullet refuses a robot or the world, or there are too many robots.
        """
        check_number(robots)
        settings = Settings(
            self.time_step, self.solver_iterations, self.wheel_friction, self.steering_lag_s
        )
        with _prepare(robots, world, settings) as (engine, model):
            alone = [robot for robot, _ in robots]
            yield PyBulletSimulation(engine, model, alone, settings, world.crowd)


@contextmanager
def _prepare(
    robots: Sequence[PlacedRobot], world: World, settings: Settings
) -> Iterator[tuple[Engine, Model]]:
    """Take an idle engine, or make one, and place the robots.

    An engine keeps its model. If its last mission had these robots and this world, and only the
    robots have moved, the model is reset instead of rebuilt, which gives the same bits.
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
