"""A wheeled robot on flat ground, tens of thousands of times faster than real time.

The centre of the rear axle rolls along arcs without slip (the bicycle model). The outline of the
robot stops at obstacles and at other robots. In missions that go on after contact, it pushes
movable bodies. Sensors cast the same rays at the same shapes as with a rigid-body
engine. ``docs/fidelity.md`` shows how far the two simulators agree.
"""

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

from evoros.base.checks import LEAST_STEP_S, NOT_NEGATIVE, checked, number_between
from evoros.base.errors import InputError
from evoros.robot.model import Robot
from evoros.sensor.protocol import CONTACT, RANGE, SIGNAL_SIZES
from evoros.simulator.engines.planar_bodies import can_push
from evoros.simulator.engines.planar_layout import lay_out, lay_out_memory
from evoros.simulator.engines.planar_rules import (
    advance,
    advance_feeling,
    advance_pushing,
    observe,
)
from evoros.simulator.engines.planar_sensing import sense, sense_pushing, sense_signals
from evoros.simulator.engines.planar_signals import probe_rows
from evoros.simulator.engines.planar_team import advance_team, observe_team, sense_team
from evoros.simulator.engines.planar_team_layout import lay_out_team
from evoros.simulator.engines.planar_team_pushing import (
    advance_team_pushing,
    sense_team_pushing,
)
from evoros.simulator.engines.teams import check_team
from evoros.simulator.protocol import (
    AdvanceRule,
    PlacedRobot,
    RuleSimulation,
    SenseRule,
    SimulationRules,
)
from evoros.world.model import World

MAX_STEP_S = 0.1
"""Contact is tested after each step; a longer step could jump over a thin wall."""


@dataclass(frozen=True)
@checked
class Planar:
    """The planar simulator: wheels without slip, servos that lag, obstacles that stop the robot.

    Raises:
        InputError: a value out of range.
    """

    time_step: Annotated[float, number_between(LEAST_STEP_S, MAX_STEP_S)] = 0.02  # [s]
    steering_lag_s: Annotated[float, NOT_NEGATIVE] = 0.05  # time constant of the servos
    drive_lag_s: Annotated[float, NOT_NEGATIVE] = 0.0  # time constant of the speed
    packages = ("numba",)
    measures = (RANGE, *SIGNAL_SIZES)

    def choose_rules(self, world: World, robots: Sequence[Robot]) -> SimulationRules:
        """Return the rules of motion.

        Those of pushing, of contact sensors and of several robots take a while to compile.
        """
        pushes = can_push(world)
        if len(robots) > 1:
            if pushes:
                return SimulationRules(observe_team, sense_team_pushing, advance_team_pushing)
            return SimulationRules(observe_team, sense_team, advance_team)
        measured = {sensor.measures for robot in robots for sensor in robot.mounted_sensors()}
        read: SenseRule = sense_pushing if pushes else sense
        drive: AdvanceRule = advance_pushing if pushes else advance
        if not measured <= {RANGE}:
            read = sense_signals
        if CONTACT in measured:
            drive = advance_feeling
        return SimulationRules(observe, read, drive)

    def check_world(self, world: World) -> None:
        """Refuse worlds whose ground is not level.

        Raises:
            InputError: the ground is a height field or a tilted plane.
        """
        if not _is_level(world):
            raise InputError(
                "must have level ground for simulator=planar, in which robots stay level, not a "
                "height field or a tilted plane; use simulator=physics"
            )

    def open(self, robot: Robot, world: World) -> AbstractContextManager[RuleSimulation]:
        """Place the robot at the world's home, at rest.

        Raises:
            InputError: the ground is not level.
        """
        return self.open_team([PlacedRobot(robot, world.course.home)], world)

    @contextmanager
    def open_team(self, robots: Sequence[PlacedRobot], world: World) -> Iterator[RuleSimulation]:
        """Place each robot at its own home, at rest.

        Raises:
            InputError: the ground is not level.
            SimulationError: there are too many robots.
        """
        self.check_world(world)  # a sampler may have drawn it
        check_team(robots)
        rules = self.choose_rules(world, [robot for robot, _ in robots])
        lags = self.steering_lag_s, self.drive_lag_s
        tallest, gravity = max(robot.height_m for robot, _ in robots), world.gravity_mps2
        parameters = [
            lay_out(robot, world, self.time_step, *lags, probe_rows(robot, gravity), tallest)
            for robot, _ in robots
        ]
        homes = [(home[0], home[1], home[3]) for _, home in robots]
        memories = list(map(lay_out_memory, parameters, homes))
        if len(robots) > 1:
            team = lay_out_team([robot for robot, _ in robots], parameters, memories)
            yield RuleSimulation(rules, *team)
        else:
            yield RuleSimulation(rules, parameters[0], memories[0])


@lru_cache(maxsize=64)
def _is_level(world: World) -> bool:
    return world.is_level
