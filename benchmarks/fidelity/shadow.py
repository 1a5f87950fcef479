"""Runs a mission in PyBullet and reads the planar simulator's sensors along the way.

At every control step, the planar robot is moved to the place of PyBullet's robot, and both
simulators sense.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from evoros.base.arrays import CONTACT, STATE_SIZE, Array
from evoros.base.packing import unpack
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.mission.mission import Mission
from evoros.mission.rollout import run_mission
from evoros.simulator.engines.planar_layout import Memory
from evoros.simulator.engines.pybullet_simulation import PyBulletSimulation
from evoros.simulator.planar import Planar
from evoros.simulator.protocol import PlacedRobot, RuleSimulation, Simulator
from evoros.simulator.pybullet import PyBullet
from evoros.world.model import World


@dataclass
class Log:
    """The record of a mission, with a row for each control step."""

    states: list[Array] = field(default_factory=list)  # (STATE_SIZE,)
    attitudes: list[tuple[float, float, float]] = field(
        default_factory=list
    )  # z [m], roll, pitch [rad]
    readings: list[Array] = field(default_factory=list)  # PyBullet's [m]
    shadows: list[Array] = field(default_factory=list)  # the planar simulator's [m]
    commands: list[Array] = field(default_factory=list)


@dataclass(frozen=True)
class ShadowedPyBullet(Simulator):
    """PyBullet with the planar simulator as its shadow."""

    log: Log
    engine: PyBullet = field(default_factory=PyBullet)
    time_step = PyBullet.time_step
    packages = ("pybullet", "numba")

    @contextmanager
    def open(self, robots: Sequence[PlacedRobot], world: World) -> Iterator["_Simulation"]:
        """Place the robot in both simulators."""
        with self.engine.open(robots, world) as real, Planar().open(robots, world) as shadow:
            yield _Simulation(self.log, real, shadow)


@dataclass
class _Simulation:
    log: Log
    real: PyBulletSimulation
    shadow: RuleSimulation
    state: Array = field(default_factory=lambda: np.zeros(STATE_SIZE))

    def observe(self, state: Array) -> None:
        self.real.observe(state)
        self.state[:] = state

    def sense(self, readings: Array) -> None:
        self.real.sense(readings)
        shadow_readings = np.zeros(len(readings))
        motion = unpack(Memory, self.shadow.memory).motions[0]
        motion[:STATE_SIZE] = self.state
        motion[CONTACT] = 0.0
        self.shadow.sense(shadow_readings)
        self.log.states.append(self.state.copy())
        self.log.attitudes.append(self._attitude())
        self.log.readings.append(readings.copy())
        self.log.shadows.append(shadow_readings)

    def _attitude(self) -> tuple[float, float, float]:
        bullet, model = self.real._bullet, self.real._model
        centre = bullet.getBasePositionAndOrientation(model.robots[0].body)
        position, facing = bullet.multiplyTransforms(*centre, *model.robots[0].to_base)
        roll, pitch, _ = bullet.getEulerFromQuaternion(facing)
        return position[2], roll, pitch

    def advance(self, command: Array, duration: float) -> None:
        self.log.commands.append(command.copy())
        self.real.advance(command, duration)


def run_shadowed(experiment: Experiment, design: Design, world: str, draws: str) -> Log:
    """Run one mission in PyBullet; returns its log."""
    log = Log()
    scenario = replace(experiment.scenario, simulator=ShadowedPyBullet(log))
    run_mission(scenario, Mission(0, 0, design, world, 0, "evaluation", draws))
    return log
