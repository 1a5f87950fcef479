"""Deterministic rigid-body physics in PyBullet, run in this process without a display.

The set-up is the cheapest that is accurate; ``benchmarks/fidelity/engine.py`` measures each choice:

- Wheels collide only with the ground; the chassis, which covers the wheels, collides with
  obstacles.
- Movable bodies sleep until a robot comes near. In missions that continue after contact, steps are
  finer while such bodies move.
- Links on fixed joints are merged.
- Collisions are skipped between bodies that cannot move relative to each other.
- Rays are computed once, in the chassis frame, and the engine moves them with the chassis.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import Annotated

from evoros.base.checks import COUNT, LEAST_STEP_S, NOT_NEGATIVE, POSITIVE, checked, number_between
from evoros.drive.protocol import Drive
from evoros.simulator.engines import pybullet_model
from evoros.simulator.engines.idle import IdleEngines
from evoros.simulator.engines.pybullet_simulation import PyBulletSimulation
from evoros.simulator.engines.teams import TeamSimulator, check_number, doubt_skidding
from evoros.simulator.protocol import PlacedRobot
from evoros.world.model import World

MAX_STEP_S = 0.025  # maximum step [s] for motion within 1 % of the finest (docs/simulation.md)

IDLE: IdleEngines[pybullet_model.Engine] = IdleEngines()


@dataclass(frozen=True)
@checked
class PyBullet(TeamSimulator):
    """The PyBullet simulator; manoeuvres are within 2 % of manoeuvres with much finer steps."""

    time_step: Annotated[float, number_between(LEAST_STEP_S, MAX_STEP_S)] = 0.025  # [s]
    solver_iterations: Annotated[int, replace(COUNT, limit=10_000)] = 20
    wheel_friction: Annotated[float, POSITIVE] = 1.0  # factor of the ground's friction coefficient
    steering_lag_s: Annotated[float, NOT_NEGATIVE] = 0.05  # time constant of the steering servos
    packages = ("pybullet",)

    def __post_init__(self) -> None:
        if find_spec("pybullet") is None:
            raise pybullet_model.not_installed()

    def doubt_drive(self, drive: Drive) -> str:
        """Return why the engine is inaccurate for skid-steer (``docs/fidelity.md``), or ""."""
        return doubt_skidding("PyBullet", drive)

    @contextmanager
    def open(self, robots: Sequence[PlacedRobot], world: World) -> Iterator[PyBulletSimulation]:
        """Open a simulation with each robot at its home pose."""
        check_number(robots)
        settings = pybullet_model.Settings(
            self.time_step, self.solver_iterations, self.wheel_friction, self.steering_lag_s
        )
        with IDLE.take(lambda: pybullet_model.Engine(pybullet_model.import_pybullet())) as engine:
            # If only robots have moved, the model is reset, with bitwise equal results.
            model, alone = engine.prepare(robots, world, settings), [robot for robot, _ in robots]
            yield PyBulletSimulation(engine, model, alone, settings, world.crowd)
