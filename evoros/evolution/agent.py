"""A robot beside the first one, in the same worlds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

from evoros.base.checks import FLAG, Rule, checked, instance_of, is_number
from evoros.base.errors import InputError
from evoros.controller.protocol import A_CONTROLLER, Controller, LiveController
from evoros.design.space import SensorDesign
from evoros.field.generated import FIXED
from evoros.mission.scenario import require_world
from evoros.robot.model import Robot
from evoros.world.course import PAIRS, Course
from evoros.world.model import TeamSampler, World

PLACE = Rule(
    "three numbers, x [m], y [m] and yaw [rad]",
    lambda v: isinstance(v, list | tuple) and len(v) == 3 and all(map(is_number, v)),
)


@dataclass(frozen=True)
@checked
class Agent:
    """A robot with a home of its own; what is None it has in common with the first robot.

    With a ``design`` of its own that design evolves beside the first robot's; otherwise one design
    evolves for both. Its home is the same in all worlds.
    """

    home: Annotated[Sequence[float], PLACE]  # x, y [m], yaw [rad]
    route: Annotated[Sequence[Sequence[float]] | None, PAIRS] = None  # the corners [m]
    robot: Annotated[Robot | None, instance_of(Robot, "a robot")] = None
    design: Annotated[SensorDesign | None, instance_of(SensorDesign, "a sensor design")] = None
    controller: Annotated[Controller | LiveController | None, A_CONTROLLER] = None
    scored: Annotated[bool, FLAG] = False  # whether its missions count for the fitness, too

    def place(self, course: Course) -> Course:
        """Return the course of a world with this robot's home and route."""
        x, y, yaw = map(float, self.home)
        route = course.waypoints if self.route is None else self.route
        return replace(course, home_x_m=x, home_y_m=y, home_yaw_rad=yaw, waypoints=route)


def make_room(agents: Mapping[str, Agent], worlds: Mapping[str, World]) -> dict[str, World]:
    """Return the worlds, of which those that are drawn for each mission leave room to all robots.

    Raises:
        InputError: a sampler cannot do that, or finds no room.
    """
    return {name: _make_room(agents, name, world) for name, world in worlds.items()}


def _make_room(agents: Mapping[str, Agent], name: str, world: World) -> World:
    if not agents:
        return world
    require_world(name, world)
    sampler = world.sampler
    if sampler is None:
        return world
    if not isinstance(sampler, TeamSampler):
        raise InputError(
            f"world.{name}: must have a sampler with the method keep_free if there are agents, "
            f"whose courses must be free in all drawn worlds, not {type(sampler).__name__}; add "
            f"that method, or choose a world that stays the same"
        )
    try:
        larger = sampler.keep_free([agent.place(world.course) for agent in agents.values()])
        return replace(larger.draw_world(FIXED), sampler=larger)
    except InputError as error:
        raise InputError(f"world.{name}, with agents {', '.join(agents)}: {error}") from None
