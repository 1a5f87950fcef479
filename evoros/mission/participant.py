"""A robot in a mission: its route, its draws and its faults."""

from collections.abc import Sequence
from dataclasses import dataclass

from numpy.random import Generator

from evoros.base.arrays import Array
from evoros.base.rng import generator
from evoros.failure.protocol import Failure, Fault
from evoros.mission.fault_draws import Draws, draw_faults
from evoros.mission.member import Member
from evoros.mission.mission import Mission
from evoros.mission.plan import count_round
from evoros.robot.model import Robot
from evoros.world.course import Course
from evoros.world.model import World


@dataclass(frozen=True)
class Participant:
    """A robot with its sensors in the world of a mission."""

    member: Member
    course: Course
    route: Array  # (legs, 2) [m]
    faults: Sequence[Fault]
    draws: Draws

    @property
    def robot(self) -> Robot:
        """The robot, with its sensors."""
        return self.member.robot


def enter(member: Member, failure: Failure, world: World, mission: Mission) -> Participant:
    """Draw the route and the faults of a robot, from streams that no other robot draws from."""

    def draws(part: str) -> Generator:
        return generator(mission.draws, member.key + part)

    course = member.place(world.course)
    turn = count_round(mission.purpose, mission.generation, mission.trial)
    route = course.route(course.goes_forward(turn, draws("course")))
    case = mission.case if member.meets_cases else None
    faults = draw_faults(failure, member.robot, draws, mission.trial, case)
    return Participant(member, course, route, faults, draws)
