"""Starts a mission: its clock, its arrays and its filters."""

import math
from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from evoros.base.arrays import COMMAND_SIZE, POSE_SIZE, STATE_SIZE, Array
from evoros.base.errors import InputError
from evoros.failure.protocol import Fault
from evoros.failure.trigger import AT_START
from evoros.filter.protocol import STRENGTH
from evoros.mission.inputs import (
    COUNTS,
    FIRST_COLLISION,
    Agents,
    Arrays,
    Integers,
    LayerStage,
    Timing,
)
from evoros.mission.member import Member
from evoros.mission.outcome import ROBOT_COLUMNS
from evoros.mission.part_faults import make_driven, spoils, start_pose_faults, wire
from evoros.mission.participant import Participant
from evoros.mission.pipeline import Clocks, start_localization, start_sensor_filters
from evoros.mission.scenario import Scenario
from evoros.mission.stages import Stages
from evoros.mission.triggers import TRIGGER_SIZE, make_row
from evoros.simulator.protocol import weakens_wheels
from evoros.walkers.layout import REPORT_SIZE
from evoros.world.model import World

MIN_RECORD_S = 0.05
"""A trajectory has a row for each decision, or fewer if decisions are closer than this time [s]."""


class Started(NamedTuple):
    """A mission that has all but its engine."""

    agents: Agents
    timing: Timing
    arrays: Arrays
    stages: Sequence[Stages]  # of each robot
    clocks: Sequence[Clocks]  # of each robot
    weakens_wheels: bool  # whether the simulator does


def start(
    scenario: Scenario,
    participants: Sequence[Participant],
    layers: Sequence[Sequence[LayerStage]],
    world: World,
) -> Started:
    """Start the filters of a mission in a world; ``layers`` has those of each robot's controller.

    Raises:
        InputError: a filter refuses to start.
    """
    steps = [_count_steps(scenario, participant.member) for participant in participants]
    sense, decide = zip(*steps, strict=True)
    common = math.gcd(*sense, *decide)
    tick = common * scenario.simulator.time_step
    # The time limit is the world's, the same for all robots. A trajectory has one clock for all
    # rows: the decisions of the first robot, which every mission has.
    limit = math.ceil(round(participants[0].course.time_limit_s / tick, 6))
    period = decide[0] // common
    record = period * math.ceil(MIN_RECORD_S / (period * tick) - 1e-9)
    timing = Timing(tick, record, limit, first=0, last=limit, row=0)
    agents = _describe_agents(participants, layers, np.array([sense, decide]) // common)
    clocks, triggers = _list_triggers(participants)
    walkers = 0 if world.crowd is None else len(world.crowd.names)
    arrays = _create_arrays(participants, agents, timing, triggers, walkers * REPORT_SIZE)
    stages = _start_stages(participants, layers, arrays, tick, clocks)
    weakens = weakens_wheels(scenario.simulator)
    started = Started(agents, timing, arrays, stages, clocks, weakens)
    faults = [fault for participant in participants for fault in participant.faults]
    started = connect_drives(started, faults)
    for participant, stage, known in zip(participants, started.stages, clocks, strict=True):
        if stage.actuation is not None:
            stage.actuation.add(participant, known)
    return started


def _describe_agents(
    participants: Sequence[Participant], layers: Sequence[Sequence[LayerStage]], periods: Integers
) -> Agents:
    """Describe robots to the loop; ``periods`` (2, robots) are of sensing and deciding [ticks]."""
    return Agents(
        acceptance=np.array([item.course.acceptance_m for item in participants], dtype=float),
        end_on_collision=np.array([item.course.end_on_collision for item in participants]),
        awaited=np.array([participant.member.scored for participant in participants]),
        sense_every=periods[0],
        decide_every=periods[1],
        routes=_add_up([len(participant.route) for participant in participants]),
        layers=_add_up(list(map(len, layers))),
        readings=_add_up([participant.robot.channel_count for participant in participants]),
        estimates=_add_up([len(item.member.pose_columns) for item in participants]),
    )


def connect_drives(started: Started, faults: Sequence[Fault]) -> Started:
    """Put stages between controllers and drives, if faults need them and there are none yet.

    Raises:
        InputError: wheels can fail, and the simulator has no weak wheels.
    """
    if spoils(faults, STRENGTH) and not started.weakens_wheels:
        raise InputError(
            "failure: must leave the wheels alone with this simulator, which has no weak wheels "
            "(weakens_wheels); choose another failure, for example failure=drive, or use another "
            "simulator, for example simulator=planar"
        )
    driven = make_driven(started.arrays, len(started.stages), faults)
    if driven is started.arrays.driven:
        return started
    actuations = [stage.actuation for stage in started.stages]
    wired = wire(actuations, started.arrays.commands, driven)
    stages = [
        stage._replace(actuation=actuation)
        for stage, actuation in zip(started.stages, wired, strict=True)
    ]
    return started._replace(arrays=started.arrays._replace(driven=driven), stages=stages)


def _list_triggers(participants: Sequence[Participant]) -> tuple[list[Clocks], Array]:
    """Return the clock of each trigger of each robot, and the triggers as the loop has them."""
    clocks: list[Clocks] = []
    rows: list[list[float]] = []
    for index, participant in enumerate(participants):
        triggers = {fault.trigger: None for fault in participant.faults}
        triggers.pop(AT_START, None)
        clocks.append({trigger: len(rows) + 1 + n for n, trigger in enumerate(triggers)})
        course, route = participant.course, participant.route
        home = course.home
        rows += [make_row(index, trigger, home, route, home) for trigger in triggers]
    return clocks, np.array(rows, dtype=float).reshape(len(rows), TRIGGER_SIZE)


def _count_steps(scenario: Scenario, member: Member) -> tuple[int, int]:
    """Return the time steps between two readings of any sensor, and between two decisions."""
    robot = member.robot
    decide = scenario.count_steps("controller.period_s", member.controller.period_s)
    types = {mount.sensor for mount in robot.mounts}
    periods = [scenario.count_steps(name, robot.sensors[name].period_s) for name in sorted(types)]
    return (math.gcd(*periods) if periods else decide), decide


def _add_up(sizes: Sequence[int]) -> Integers:
    """Return the start of each part, and the end of the last one."""
    return np.array(list(accumulate(sizes, initial=0)))


def _create_arrays(
    participants: Sequence[Participant],
    agents: Agents,
    timing: Timing,
    triggers: Array,
    reports: int,
) -> Arrays:
    robots = len(participants)
    commands = np.zeros(robots * COMMAND_SIZE)
    # A row for each time to record, and one for the end of each robot.
    rows = timing.limit // timing.record_every + 1 + robots
    columns = 1 + robots * len(ROBOT_COLUMNS) + agents.readings[-1] + agents.estimates[-1]
    columns += reports
    counts = np.zeros((COUNTS, robots))
    counts[FIRST_COLLISION] = -1.0
    legs = [(*participant.course.home[:2], *participant.route[0]) for participant in participants]
    return Arrays(
        routes=np.concatenate([participant.route for participant in participants]),
        states=np.zeros(robots * STATE_SIZE + reports),
        poses=np.zeros(robots * STATE_SIZE),
        legs=np.array(legs, dtype=float).ravel(),
        commands=commands,
        driven=commands,
        signals=np.zeros(sum(participant.robot.signal_count for participant in participants)),
        readings=np.zeros(agents.readings[-1]),
        decisions=np.zeros(robots + agents.layers[-1]),
        counts=counts,
        clocks=np.zeros(1 + len(triggers)),
        triggers=triggers,
        trajectory=np.empty((rows, columns)),
    )


def _start_stages(
    participants: Sequence[Participant],
    layers: Sequence[Sequence[LayerStage]],
    arrays: Arrays,
    tick: float,
    clocks: Sequence[Clocks],
) -> list[Stages]:
    """Start the filters of each robot's sensors and localization, and its faults."""
    stages = []
    signal = reading = 0
    for index, participant in enumerate(participants):
        robot, draws = participant.robot, participant.draws
        signals = arrays.signals[signal : signal + robot.signal_count]
        readings = arrays.readings[reading : reading + robot.channel_count]
        faults, known = participant.faults, clocks[index]
        filters = start_sensor_filters(robot, faults, signals, readings, tick, draws, known)
        pose = arrays.poses[index * STATE_SIZE :][:POSE_SIZE]
        controller = participant.member.controller
        localization = start_localization(controller, robot, readings, pose, draws)
        localization += start_pose_faults(participant, pose, known)
        stages.append(Stages(filters, localization, layers[index]))
        signal, reading = signal + robot.signal_count, reading + robot.channel_count
    return stages
