"""A wheeled robot on flat ground, tens of thousands of times faster than real time.

The centre of the rear axle rolls along arcs without slip (the bicycle model). The outline of the
robot stops at obstacles. In missions that go on after contact, it pushes movable bodies. Sensors
cast the same rays at the same shapes as with a rigid-body engine. ``docs/fidelity.md`` shows how
far the two simulators agree.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated

from evoros.base.checks import NOT_NEGATIVE, checked, positive_up_to
from evoros.base.errors import InputError
from evoros.robot.model import Robot
from evoros.simulator.engines.planar_bodies import can_push
from evoros.simulator.engines.planar_layout import lay_out, lay_out_memory
from evoros.simulator.engines.planar_rules import advance, advance_pushing, observe
from evoros.simulator.engines.planar_sensing import sense, sense_pushing
from evoros.simulator.protocol import RuleSimulation, SimulationRules
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

    time_step: Annotated[float, positive_up_to(MAX_STEP_S)] = 0.02  # [s]
    steering_lag_s: Annotated[float, NOT_NEGATIVE] = 0.05  # time constant of the servos
    drive_lag_s: Annotated[float, NOT_NEGATIVE] = 0.0  # time constant of the speed
    packages = ("numba",)

    def choose_rules(self, world: World) -> SimulationRules:
        """Return the rules of motion; those of pushing take a while to compile."""
        if can_push(world):
            return SimulationRules(observe, sense_pushing, advance_pushing)
        return SimulationRules(observe, sense, advance)

    def check_world(self, world: World) -> None:
        """Refuse worlds whose ground is not level.

        Raises:
            InputError: the ground is a height field or a tilted plane.
        """
        if not _is_level(world):
            raise InputError(
                "must have level ground for simulator=planar, in which robots stay level, not a "
                "height field or a tilted plane; use simulator=pybullet"
            )

    @contextmanager
    def open(self, robot: Robot, world: World) -> Iterator[RuleSimulation]:
        """Place the robot at the world's home, at rest.

        Raises:
            InputError: the ground is not level.
        """
        self.check_world(world)  # a sampler may have drawn it
        home_x, home_y, _, home_yaw = world.course.home
        lags = self.steering_lag_s, self.drive_lag_s
        parameters = lay_out(robot, world, self.time_step, *lags)
        memory = lay_out_memory(parameters, (home_x, home_y, home_yaw))
        yield RuleSimulation(self.choose_rules(world), parameters, memory)


@lru_cache(maxsize=64)
def _is_level(world: World) -> bool:
    return world.is_level
