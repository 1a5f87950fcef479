"""Wheeled robots on flat ground, simulated tens of thousands of times faster than real time.

The centre of the rear axle moves along arcs without slip (bicycle model). A robot stops when its
outline meets an obstacle or another robot. In missions that continue after contact, the robot
pushes movable bodies. Sensors cast the same rays at the same shapes as in a rigid-body engine.
``docs/fidelity.md`` compares the simulators.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

from evoros.base.checks import LEAST_STEP_S, NOT_NEGATIVE, checked, number_between
from evoros.base.errors import InputError
from evoros.robot.model import Robot
from evoros.sensor.protocol import CONTACT, RANGE, SIGNAL_SIZES
from evoros.simulator.engines import planar_rules
from evoros.simulator.engines.planar_bodies import can_push
from evoros.simulator.engines.planar_sensing import sense, sense_signals
from evoros.simulator.engines.planar_start import lay_out
from evoros.simulator.engines.teams import MAX_ROBOTS, check_number
from evoros.simulator.protocol import PlacedRobot, RuleSimulation, RuleSimulator, SimulationRules
from evoros.world.model import KEPT_WORLDS, World

MAX_STEP_S = 0.1
"""Maximum step [s]; contact is tested after each step, and longer ones could cross a wall."""


@dataclass(frozen=True)
@checked
class Planar(RuleSimulator):
    """The planar simulator: no wheel slip, servos that lag, and obstacles that stop the robot."""

    time_step: Annotated[float, number_between(LEAST_STEP_S, MAX_STEP_S)] = 0.02  # [s]
    steering_lag_s: Annotated[float, NOT_NEGATIVE] = 0.05  # time constant of the steering servos
    drive_lag_s: Annotated[float, NOT_NEGATIVE] = 0.0  # time constant of the drive speed
    packages = ("numba",)
    measures = (RANGE, *SIGNAL_SIZES)
    max_robots = MAX_ROBOTS
    has_walkers = True
    weakens_wheels = True

    def choose_rules(self, world: World, robots: Sequence[Robot]) -> SimulationRules:
        """Return the rules; pushing, walkers and sensors without rays take longer to compile."""
        measured = {sensor.measures for robot in robots for sensor in robot.mounted_sensors()}
        pushes = can_push(world) or CONTACT in measured
        among = planar_rules.advance_pushing if pushes else planar_rules.advance
        return SimulationRules(
            planar_rules.observe,
            sense if measured <= {RANGE} else sense_signals,
            among if world.crowd is None else planar_rules.advance_among_walkers,
        )

    def check_world(self, world: World) -> None:
        """Reject worlds whose ground is not level."""
        if not _is_level(world):
            raise InputError(
                "the ground is a height field or a tilted plane, but simulator=planar needs level "
                "ground; use simulator=physics"
            )

    @contextmanager
    def open(self, robots: Sequence[PlacedRobot], world: World) -> Iterator[RuleSimulation]:
        """Place each robot at rest at its home pose."""
        self.check_world(world)  # a sampler may have drawn this world
        check_number(robots)
        rules = self.choose_rules(world, [robot for robot, _ in robots])
        lags = self.steering_lag_s, self.drive_lag_s
        yield RuleSimulation(rules, *lay_out(robots, world, self.time_step, lags))


@lru_cache(maxsize=KEPT_WORLDS)
def _is_level(world: World) -> bool:
    return world.is_level
