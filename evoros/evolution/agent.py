"""Additional robots in the worlds of a run, and checks that all robots have room."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Annotated

import numpy as np

from evoros.base import elementary
from evoros.base.arrays import product
from evoros.base.checks import FLAG, Rule, checked, instance_of, is_number
from evoros.base.errors import InputError
from evoros.controller.protocol import A_CONTROLLER, Controller, LiveController
from evoros.design.space import SensorDesign
from evoros.field.drawn import FIXED
from evoros.geometry.clearance import compute_clearances
from evoros.geometry.footprint import Footprint
from evoros.mission.member import Member, find_declared_genes
from evoros.mission.scenario import require_world
from evoros.robot.model import Robot
from evoros.world.course import PAIRS, Course
from evoros.world.model import TeamSampler, World

PLACE = Rule(
    "three numbers: x [m], y [m] and yaw [rad]",
    lambda v: isinstance(v, list | tuple) and len(v) == 3 and all(map(is_number, v)),
)


@dataclass(frozen=True)
@checked
class Agent:
    """An additional robot, which has the same home in all worlds.

    A part that is None is the first robot's. A ``design`` evolves together with that robot's.
    """

    home: Annotated[Sequence[float], PLACE]  # x, y [m], yaw [rad]
    route: Annotated[Sequence[Sequence[float]] | None, PAIRS] = None  # corners [m]
    robot: Annotated[Robot | None, instance_of(Robot, "a robot")] = None
    design: Annotated[SensorDesign | None, instance_of(SensorDesign, "a sensor design")] = None
    controller: Annotated[Controller | LiveController | None, A_CONTROLLER] = None
    scored: Annotated[bool, FLAG] = False  # whether the fitness includes this robot's missions

    def join(self, name: str, first: Member) -> Member:
        """Return this robot as a named member of the scenario; ``first`` is the first member."""
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


def make_room(members: Sequence[Member], worlds: Mapping[str, World]) -> dict[str, World]:
    """Return the worlds, with samplers that leave room for all robots."""
    placed = [member for member in members if member.home is not None]
    return {
        name: _make_room(placed, name, world) if placed else world for name, world in worlds.items()
    }


def _make_room(placed: Sequence[Member], name: str, world: World) -> World:
    require_world(name, world)
    sampler = world.sampler
    if sampler is None:
        return world
    if not isinstance(sampler, TeamSampler):
        raise InputError(
            f"world.{name}: the sampler {type(sampler).__name__} lacks the method keep_free, which "
            "keeps the agents' courses free in all drawn worlds; add that method, or choose a "
            "fixed world"
        )
    try:
        larger = sampler.keep_free([member.place(world.course) for member in placed])
        return replace(larger.draw_world(FIXED), sampler=larger)
    except InputError as error:
        names = ", ".join(member.name for member in placed)
        raise InputError(f"world.{name}, with agents {names}: {error}") from None


def check_team(members: Sequence[Member], worlds: Mapping[str, World]) -> None:
    """Check that the robots of an experiment are compatible."""
    designed = {member.name: member for member in members if member.has_own_design}
    for member in members:
        _check_design(member, designed[member.designed])
    for name, world in worlds.items():
        for one, other in combinations(members, 2):
            _check_homes(one, other, name, world.course)


def _check_design(member: Member, owner: Member) -> None:
    if member.robot != owner.robot:
        raise InputError(
            f"{member.key}design: must be set, because this robot differs from the first robot and "
            f"design regions lie on a robot's body; for example, add /design@{member.name}.design: "
            f"around to the defaults list"
        )
    design = member.design
    evolves = design.max_number > 0 or design.genes or find_declared_genes(member.controller)
    if member is owner and evolves and not member.scored:
        raise InputError(
            f"{member.key}scored: must be true if the robot's separate design evolves, because "
            "otherwise nothing would select the design; set scored to true, or use a design with "
            "number 0 and fixed sensors"
        )


def _check_homes(one: Member, other: Member, world: str, course: Course) -> None:
    if _touch(one, other, course):
        first = one.key.removesuffix(".") or "the first robot"
        raise InputError(
            f"{other.key}home: must be clear of {first} in world.{world}, but the robots touch at "
            f"{_place(other, course)}; move the home"
        )


def _place(member: Member, course: Course) -> list[float]:
    x, y, _, yaw = member.place(course).home
    return [x, y, yaw]


def _touch(one: Member, other: Member, course: Course) -> bool:
    x, y, yaw = _place(other, course)
    sin, cos = elementary.sin_cos(yaw)
    turn = np.array([[cos, -sin], [sin, cos]])
    footprint = Footprint(product(other.robot.outline, turn.T) + np.array([x, y]), 0.0)
    at = np.array([_place(one, course)])
    return float(compute_clearances(one.robot.outline, at, [footprint])[0]) <= 0.0
