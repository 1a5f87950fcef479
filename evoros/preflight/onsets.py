"""Finds onsets of failures that never come: waypoints and places that no course and world has."""

import math
from collections.abc import Iterator

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError
from evoros.base.rng import generator
from evoros.failure.protocol import Fault, list_parts
from evoros.failure.trigger import DISTANCE, PLACE, WAYPOINT, Trigger
from evoros.geometry.footprint import find_bounds, project_bodies
from evoros.mission.fault_draws import draw_faults
from evoros.mission.triggers import measure_legs
from evoros.preflight.subject import Subject, choose_middle
from evoros.world.model import World

DRAWS = 20
"""Missions whose faults are drawn."""


def check_onsets(subject: Subject) -> Iterator[str]:
    """Require that each event at which a part fails can come in a world; warn of the others.

    Raises:
        InputError: it can come in none.
    """
    for trigger in _list_triggers(subject):
        found = {name: find_problem(trigger, world) for name, world in subject.world.items()}
        problems = {name: problem for name, problem in found.items() if problem}
        if len(problems) == len(found):
            raise InputError(f"failure.onset: must be {next(iter(problems.values()))}; correct it")
        for name, problem in problems.items():
            yield f"failure.onset: never comes in {name}, because it must be {problem}"


def _list_triggers(subject: Subject) -> list[Trigger]:
    """List the triggers of faults of some missions, each once; none if sensors alone can fail."""
    if not list_parts(subject.failure):
        return []
    (member,) = subject.scenario.equip(choose_middle(subject.space))
    faults: list[Fault] = []
    for index in range(DRAWS):

        def draws(part: str, index: int = index) -> np.random.Generator:
            return generator(f"preflight/onsets/{index}", part)

        faults += draw_faults(subject.failure, member.robot, draws, index)
    return list(dict.fromkeys(fault.trigger for fault in faults))


def find_problem(trigger: Trigger, world: World) -> str:
    """Return the rule that an event breaks in a world, and its value; empty if it can come."""
    course = world.course
    lengths = measure_legs(course.home, course.route(True))
    if trigger.kind == WAYPOINT and trigger.values[0] > len(lengths):
        return (
            f"at one of the {len(lengths)} waypoints of the route (the corners and home, both "
            f"ways), not at waypoint {trigger.values[0]:g}"
        )
    total = math.fsum(lengths)
    if trigger.kind == DISTANCE and trigger.values[0] > total:
        return f"within the route, which is {total:.1f} m long, not after {trigger.values[0]:.4g} m"
    if trigger.kind == PLACE:
        x, y, radius = trigger.values
        (left, below), (right, above) = _find_extent(world)
        if not (left - radius <= x <= right + radius and below - radius <= y <= above + radius):
            return (
                f"in the world, which has x {left:.2f}..{right:.2f} and y {below:.2f}..{above:.2f} "
                f"m, not at ({x:g}, {y:g}) m"
            )
    return ""


def _find_extent(world: World) -> Array:
    """Return the lower left and the upper right corner [m] of all obstacles and the course."""
    course = world.course
    corners = [np.array([course.home[:2], *course.waypoints])]
    areas = project_bodies(world.obstacles)
    if areas:
        corners.append(np.array(find_bounds(*areas)))
    points = np.concatenate(corners)
    return np.stack([points.min(axis=0), points.max(axis=0)])
