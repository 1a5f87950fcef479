"""Checks that the robots of an experiment fit together, in worlds with room for all."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from evoros.base import elementary
from evoros.base.errors import InputError
from evoros.base.linear import product
from evoros.field.drawn import FIXED
from evoros.geometry.clearance import compute_clearances
from evoros.geometry.footprint import Footprint
from evoros.mission.member import Member, find_declared_genes
from evoros.mission.scenario import require_world
from evoros.world.course import Course
from evoros.world.model import TeamSampler, World


def make_room(members: Sequence[Member], worlds: Mapping[str, World]) -> dict[str, World]:
    """Return the worlds; those that are drawn for each mission leave room to all robots.

    Raises:
        InputError: a sampler cannot do that, or finds no room.
    """
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
            f"world.{name}: must have a sampler with the method keep_free if there are agents, "
            f"whose courses must be free in all drawn worlds, not {type(sampler).__name__}; add "
            f"that method, or choose a world that stays the same"
        )
    try:
        larger = sampler.keep_free([member.place(world.course) for member in placed])
        return replace(larger.draw_world(FIXED), sampler=larger)
    except InputError as error:
        names = ", ".join(member.name for member in placed)
        raise InputError(f"world.{name}, with agents {names}: {error}") from None


def check_team(members: Sequence[Member], worlds: Mapping[str, World]) -> None:
    """Check the robots of an experiment against one another.

    Raises:
        InputError: a design of another robot, genes without effect, or robots that touch at home.
    """
    designed = {member.name: member for member in members if member.has_own_design}
    for member in members:
        _check_design(member, designed[member.designed])
    for name, world in worlds.items():
        for one, other in combinations(members, 2):
            _check_homes(one, other, name, world.course)


def _check_design(member: Member, owner: Member) -> None:
    """Check a robot that has the design of ``owner``, its own or another one's."""
    if member.robot != owner.robot:
        raise InputError(
            f"{member.key}design: must be given for another robot than the first one, because "
            f"its regions lie on its robot; add for example /design@{member.name}.design: "
            f"around to the defaults"
        )
    design = member.design
    evolves = design.max_number > 0 or design.genes or find_declared_genes(member.controller)
    if member is owner and evolves and not member.scored:
        raise InputError(
            f"{member.key}scored: must be true if the robot's own design evolves, because "
            f"nothing would select it; set it to true, or use a design with number 0 and fixed "
            f"sensors"
        )


def _check_homes(one: Member, other: Member, world: str, course: Course) -> None:
    """Require that two robots do not touch at home."""
    if _touch(one, other, course):
        first = one.key.removesuffix(".") or "the first robot"
        raise InputError(
            f"{other.key}home: must be clear of {first} in world.{world}, not "
            f"{_place(other, course)}, where the two touch; move it"
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
