"""A robot in a mission: its route, its draws, its faults, and its part of the mission loop."""

import math
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from numpy.random import Generator

from evoros.base.arrays import COMMAND_SIZE, POSE_SIZE, STATE_SIZE, Array
from evoros.base.rng import generator
from evoros.failure.protocol import Failure, Fault
from evoros.mission.live_layers import open_layers
from evoros.mission.loop import (
    COUNTS,
    FIRST_COLLISION,
    Agents,
    Arrays,
    FilterStage,
    LayerStage,
    Timing,
)
from evoros.mission.member import Member
from evoros.mission.mission import Mission
from evoros.mission.outcome import ROBOT_COLUMNS
from evoros.mission.pipeline import (
    Draws,
    draw_faults,
    start_localization,
    start_sensor_filters,
)
from evoros.mission.plan import count_round
from evoros.mission.scenario import Scenario
from evoros.robot.model import Robot
from evoros.world.course import Course
from evoros.world.model import World

MIN_RECORD_S = 0.05
"""A trajectory has a row for each decision, or fewer if decisions are closer than this time [s]."""


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

    @property
    def columns(self) -> int:
        """The number of its columns in a trajectory, without the time."""
        return len(ROBOT_COLUMNS) + self.robot.channel_count + self.estimated

    @property
    def estimated(self) -> int:
        """How many values of the estimated pose are columns of its own."""
        return len(self.member.pose_columns)


def enter(member: Member, failure: Failure, world: World, mission: Mission) -> Participant:
    """Draw the route and the faults of a robot.

    The draws of each robot are its own, so another robot changes nothing for it.
    """

    def draws(part: str) -> Generator:
        return generator(mission.draws, member.key + part)

    course = member.place(world.course)
    number = count_round(mission.purpose, mission.generation, mission.trial)
    route = course.route(course.goes_forward(number, draws("course")))
    case = mission.case if member.meets_cases else None
    faults = draw_faults(failure, member.robot, draws, mission.trial, case)
    return Participant(member, course, route, faults, draws)


def compute_timing(
    scenario: Scenario, participants: Sequence[Participant]
) -> tuple[Timing, list[int], list[int]]:
    """Express all periods in ticks of their greatest common divisor.

    Returns, besides the timing, the ticks between the readings and the decisions of each robot. A
    trajectory has a row for each decision of the first one.
    """
    steps = [_count_steps(scenario, each.member) for each in participants]
    sense, decide = zip(*steps, strict=True)
    common = math.gcd(*sense, *decide)
    tick = common * scenario.simulator.time_step
    limit = math.ceil(round(participants[0].course.time_limit_s / tick, 6))
    period = decide[0] // common
    record = period * math.ceil(MIN_RECORD_S / (period * tick) - 1e-9)
    timing = Timing(tick, record, limit)
    return timing, [steps // common for steps in sense], [steps // common for steps in decide]


def _count_steps(scenario: Scenario, member: Member) -> tuple[int, int]:
    """Return the time steps between two readings of any sensor, and between two decisions."""
    robot = member.robot
    decide = scenario.count_steps("controller.period_s", member.controller.period_s)
    types = {mount.sensor for mount in robot.mounts}
    periods = [scenario.count_steps(name, robot.sensors[name].period_s) for name in sorted(types)]
    return (math.gcd(*periods) if periods else decide), decide


def create_arrays(participants: Sequence[Participant], timing: Timing, layers: int) -> Arrays:
    """Create the arrays of a mission, whose controllers have so many layers together."""
    robots = len(participants)
    # A row for each time to record, and one for the end of each robot.
    rows = timing.limit // timing.record_every + 1 + robots
    counts = np.zeros((COUNTS, robots))
    counts[FIRST_COLLISION] = -1.0
    legs = [(*each.course.home[:2], *each.route[0]) for each in participants]
    return Arrays(
        routes=np.concatenate([each.route for each in participants]),
        states=np.zeros(robots * STATE_SIZE),
        poses=np.zeros(robots * STATE_SIZE),
        legs=np.array(legs, dtype=float).ravel(),
        commands=np.zeros(robots * COMMAND_SIZE),
        signals=np.zeros(sum(each.robot.signal_count for each in participants)),
        readings=np.zeros(sum(each.robot.channel_count for each in participants)),
        decisions=np.zeros(robots + layers),
        counts=counts,
        trajectory=np.empty((rows, 1 + sum(each.columns for each in participants))),
    )


def create_agents(
    participants: Sequence[Participant],
    layers: Sequence[Sequence[LayerStage]],
    sense_every: Sequence[int],
    decide_every: Sequence[int],
) -> Agents:
    """Describe the robots to the loop; ``layers`` are those of each one's controller."""
    courses = [each.course for each in participants]
    return Agents(
        acceptance=tuple(course.acceptance_m for course in courses),
        end_on_collision=tuple(course.end_on_collision for course in courses),
        awaited=tuple(each.member.scored for each in participants),
        sense_every=tuple(sense_every),
        decide_every=tuple(decide_every),
        routes=_add_up(len(each.route) for each in participants),
        layers=_add_up(map(len, layers)),
        readings=_add_up(each.robot.channel_count for each in participants),
        estimates=_add_up(each.estimated for each in participants),
    )


def _add_up(sizes: Iterable[int]) -> tuple[int, ...]:
    """Return the start of each part, and the end of the last one."""
    return tuple(accumulate(sizes, initial=0))


def start_pipelines(
    participants: Sequence[Participant], tick: float, arrays: Arrays
) -> list[tuple[list[FilterStage], list[FilterStage]]]:
    """Start the filters of each robot's sensors, and those of its localization."""
    started = []
    signal = reading = 0
    for number, participant in enumerate(participants):
        robot = participant.robot
        signals = arrays.signals[signal : signal + robot.signal_count]
        readings = arrays.readings[reading : reading + robot.channel_count]
        draws, faults = participant.draws, participant.faults
        filters = start_sensor_filters(robot, faults, signals, readings, tick, draws)
        pose = arrays.poses[number * STATE_SIZE :][:POSE_SIZE]
        controller = participant.member.controller
        localization = start_localization(controller, robot, readings, pose, draws)
        started.append((filters, localization))
        signal, reading = signal + robot.signal_count, reading + robot.channel_count
    return started


def open_controllers(
    participants: Sequence[Participant], stack: ExitStack
) -> list[Sequence[LayerStage]]:
    """Start the controller of each robot; ``stack`` ends it.

    Raises:
        InputError, LaunchError, PilotLost: see ``open_layers``.
    """
    return [
        stack.enter_context(open_layers(each.member, each.course, each.route, each.draws))
        for each in participants
    ]
