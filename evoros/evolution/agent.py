"""Another robot in the same worlds."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

from evoros.base.checks import FLAG, Rule, checked, instance_of, is_number
from evoros.controller.protocol import A_CONTROLLER, Controller, LiveController
from evoros.design.space import SensorDesign
from evoros.mission.member import Member
from evoros.robot.model import Robot
from evoros.world.course import PAIRS

PLACE = Rule(
    "three numbers, x [m], y [m] and yaw [rad]",
    lambda v: isinstance(v, list | tuple) and len(v) == 3 and all(map(is_number, v)),
)


@dataclass(frozen=True)
@checked
class Agent:
    """A robot with a home of its own; it shares parts that are None with the first robot.

    With a ``design`` of its own that design evolves beside the first robot's; otherwise one design
    evolves for both. Its home is the same in all worlds.
    """

    home: Annotated[Sequence[float], PLACE]  # x, y [m], yaw [rad]
    route: Annotated[Sequence[Sequence[float]] | None, PAIRS] = None  # the corners [m]
    robot: Annotated[Robot | None, instance_of(Robot, "a robot")] = None
    design: Annotated[SensorDesign | None, instance_of(SensorDesign, "a sensor design")] = None
    controller: Annotated[Controller | LiveController | None, A_CONTROLLER] = None
    scored: Annotated[bool, FLAG] = False  # whether its missions count for the fitness, too

    def join(self, name: str, first: Member) -> Member:
        """Return the member of this name of a scenario whose first member is ``first``."""
        x, y, yaw = map(float, self.home)
        return replace(
            first,
            robot=self.robot or first.robot,
            design=self.design or first.design,
            controller=self.controller or first.controller,
            name=name,
            column=f"{name}.",
            key=f"agents.{name}.",
            designed=name if self.design else first.designed,
            home=(x, y, yaw),
            route=self.route,
            scored=self.scored,
            meets_cases=False,
        )
