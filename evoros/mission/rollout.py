"""Runs one mission, from a design to its outcome."""

import math
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import NamedTuple

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError, LaunchError, SimulationError
from evoros.mission import outcome
from evoros.mission.compiled_loop import Loop, prepare
from evoros.mission.loop import (
    COLLISION,
    COLLISIONS,
    COMPLETED,
    END_ROW,
    END_TICK,
    ENDED,
    FIRST_COLLISION,
    RUNNING,
    TIME_LIMIT,
    VISITED,
    Agents,
    Arrays,
    LayerStage,
    LoopInputs,
    LoopResult,
    Timing,
)
from evoros.mission.loop_inputs import Stages, collect_inputs
from evoros.mission.member import Member
from evoros.mission.metrics import Rollout, measure
from evoros.mission.mission import Mission
from evoros.mission.outcome import ROBOT_COLUMNS, TIME, Outcome, Outcomes
from evoros.mission.participant import (
    Participant,
    compute_timing,
    create_agents,
    create_arrays,
    enter,
    open_controllers,
    start_pipelines,
)
from evoros.mission.scenario import Scenario
from evoros.simulator.protocol import PlacedRobot

ENDINGS = {
    RUNNING: outcome.MISSION_OVER,
    COMPLETED: outcome.COMPLETED,
    COLLISION: outcome.COLLISION,
    TIME_LIMIT: outcome.TIME_LIMIT,
}
AVOIDING = "avoiding"

Prepare = Callable[[LoopInputs], tuple[Loop, LoopInputs]]
"""Chooses the loop for the inputs, and adapts these to it."""


def run_mission(
    scenario: Scenario, mission: Mission, prepare: Prepare = prepare
) -> tuple[Outcomes, Array]:
    """Run a mission and return its outcomes and its trajectory, (rows, columns).

    The columns are those of ``Scenario.name_columns``. A failure of the simulation is an outcome,
    because it would recur. So are evolved values that a part refuses, because other designs can
    still be evaluated.

    Raises:
        InputError: a part refuses to start for another reason than an evolved value.
        PilotLost: a controller outside of this process ended or did not answer.
    """
    try:
        members = scenario.equip(mission.design)
    except InputError as error:
        ended, reason = outcome.REFUSED, str(error)
    else:
        try:
            return _run(scenario, members, mission, prepare)
        except SimulationError as error:
            ended, reason = outcome.SIMULATION_FAILURE, str(error)
        except LaunchError:
            raise
        except InputError as error:
            if not any(part.values for part in mission.design.parts.values()):
                raise
            ended, reason = outcome.REFUSED, str(error)
    return failed_mission(scenario, mission, ended, reason), empty_trajectory(scenario, mission)


def failed_mission(scenario: Scenario, mission: Mission, ended: str, reason: str) -> Outcomes:
    """Create the outcomes of a mission that could not be run."""
    limit = scenario.world[mission.world].course.time_limit_s
    return tuple(
        Outcome.failure(ended, reason, limit, number, price)
        for number, price in scenario.count_sensors(mission.design)
    )


def empty_trajectory(scenario: Scenario, mission: Mission) -> Array:
    """Create the trajectory of a mission that could not be run, with all columns and no row."""
    return np.empty((0, len(scenario.name_columns(mission.design))))


def _run(
    scenario: Scenario, members: Sequence[Member], mission: Mission, prepare: Prepare
) -> tuple[Outcomes, Array]:
    """Run a mission of robots that have the sensors of their designs."""
    world = scenario.world[mission.world].at(mission.draws)
    participants = [enter(member, scenario.failure, world, mission) for member in members]
    placed = [PlacedRobot(each.robot, each.course.home) for each in participants]
    with ExitStack() as stack:
        started = start(scenario, participants, open_controllers(participants, stack))
        agents, timing, arrays = started.agents, started.timing, started.arrays
        simulation = stack.enter_context(scenario.simulator.open(placed, world))
        loop, inputs = prepare(collect_inputs(simulation, started.stages))
        result = loop(inputs, agents, timing, arrays)
    if not result.finite:
        time = result.ticks * timing.tick
        raise SimulationError(f"the state is not finite after {time:g} s")
    outcomes = tuple(
        measure(_convert_counts(i, each, agents, timing, arrays, result), each, world)
        for i, each in enumerate(participants)
    )
    return outcomes, arrays.trajectory[: result.rows]


class Started(NamedTuple):
    """A mission that has all but its engine."""

    agents: Agents
    timing: Timing
    arrays: Arrays
    stages: Sequence[Stages]


def start(
    scenario: Scenario,
    participants: Sequence[Participant],
    layers: Sequence[Sequence[LayerStage]],
) -> Started:
    """Start the filters of a mission; ``layers`` are those of each robot's controller.

    Raises:
        InputError: a filter refuses to start.
    """
    timing, sense_every, decide_every = compute_timing(scenario, participants)
    agents = create_agents(participants, layers, sense_every, decide_every)
    arrays = create_arrays(participants, timing, agents.layers[-1])
    pipelines = start_pipelines(participants, timing.tick, arrays)
    stages = [Stages(*pipeline, own) for pipeline, own in zip(pipelines, layers, strict=True)]
    return Started(agents, timing, arrays, stages)


def _convert_counts(
    number: int,
    participant: Participant,
    agents: Agents,
    timing: Timing,
    arrays: Arrays,
    result: LoopResult,
) -> Rollout:
    """Convert what the loop counted of a robot to seconds and shares."""
    counts, tick = arrays.counts[:, number], timing.tick
    ended, first = int(counts[ENDED]), int(counts[FIRST_COLLISION])
    cut_off = ended == RUNNING  # the mission did not wait for it
    rows = result.rows if cut_off else int(counts[END_ROW]) + 1
    before = agents.readings[number] + agents.estimates[number]
    start = 1 + before + number * len(ROBOT_COLUMNS)
    layers = slice(agents.layers[number] + number, agents.layers[number + 1] + number + 1)
    modes = participant.member.controller.modes
    return Rollout(
        ended=ENDINGS[ended],
        time=(result.ticks if cut_off else int(counts[END_TICK])) * tick,
        visited=int(counts[VISITED]),
        collisions=int(counts[COLLISIONS]),
        first_collision=first * tick if first >= 0 else math.nan,
        avoiding=_share_avoiding(modes, arrays.decisions[layers]),
        times=arrays.trajectory[:rows, TIME],
        track=arrays.trajectory[:rows, start : start + participant.columns],
    )


def _share_avoiding(modes: Sequence[str], decisions: Array) -> float:
    """Return the share of the decisions (1 + layers,) that the avoiding layers took."""
    counts = zip(modes, decisions[1:], strict=True)
    avoiding = sum(float(count) for mode, count in counts if mode == AVOIDING)
    return avoiding / max(float(decisions.sum()), 1.0)
