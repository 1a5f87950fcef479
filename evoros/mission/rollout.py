"""Runs one mission, from a design to its outcome."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import replace

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
    LoopInputs,
    LoopResult,
    Timing,
)
from evoros.mission.loop_inputs import Stages, collect_inputs
from evoros.mission.member import (
    Member,
    compute_timing,
    create_agents,
    create_arrays,
    create_member,
    open_controllers,
    start_pipelines,
)
from evoros.mission.metrics import Rollout, measure
from evoros.mission.mission import Mission
from evoros.mission.outcome import AGENT_COLUMNS, TRAJECTORY, Outcome
from evoros.mission.scenario import Scenario
from evoros.simulator.protocol import PlacedRobot, Simulation, TeamSimulator

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
) -> tuple[Outcome, Array]:
    """Run a mission and return its outcome and its trajectory, (rows, columns).

    The columns are those of ``TRAJECTORY`` and of ``Scenario.name_columns``. A failure of the
    simulation is an outcome, because it would recur. So are evolved values that a part refuses,
    because other designs can still be evaluated.

    Raises:
        InputError: a part refuses to start for another reason than an evolved value.
        PilotLost: a controller outside of this process ended or did not answer.
    """
    try:
        team = scenario.equip(mission.design)
    except InputError as error:
        ended, reason = outcome.REFUSED, str(error)
    else:
        try:
            return _run(team, mission, prepare)
        except SimulationError as error:
            ended, reason = outcome.SIMULATION_FAILURE, str(error)
        except LaunchError:
            raise
        except InputError as error:
            if not any(each.values for each in (mission.design, *mission.design.agents.values())):
                raise
            ended, reason = outcome.REFUSED, str(error)
    return failed_mission(scenario, mission, ended, reason), empty_trajectory(scenario, mission)


def failed_mission(scenario: Scenario, mission: Mission, ended: str, reason: str) -> Outcome:
    """Create the outcome of a mission that could not be run."""
    limit = scenario.world[mission.world].course.time_limit_s
    first, *others = (
        Outcome.failure(ended, reason, limit, number, price)
        for number, price in scenario.count_sensors(mission.design)
    )
    return replace(first, others=tuple(others))


def empty_trajectory(scenario: Scenario, mission: Mission) -> Array:
    """Create the trajectory of a mission that could not be run, with all columns and no row."""
    return np.empty((0, len(TRAJECTORY) + len(scenario.name_columns(mission.design))))


def _run(team: Mapping[str, Scenario], mission: Mission, prepare: Prepare) -> tuple[Outcome, Array]:
    """Run a mission of robots that have the sensors of their designs."""
    members = list(_create_members(team, mission))
    timing, sense_every, decide_every = compute_timing(members)
    with ExitStack() as stack:
        layers = open_controllers(members, stack)
        agents = create_agents(members, layers, sense_every, decide_every)
        arrays = create_arrays(members, timing, agents.layers[-1])
        pipelines = start_pipelines(members, timing.tick, arrays)
        stages = [Stages(*pipeline, own) for pipeline, own in zip(pipelines, layers, strict=True)]
        simulation = stack.enter_context(_open(members))
        loop, inputs = prepare(collect_inputs(simulation, stages))
        result = loop(inputs, agents, timing, arrays)
    if not result.finite:
        time = result.ticks * timing.tick
        raise SimulationError(f"the state is not finite after {time:g} s")
    first, *others = (
        measure(
            _convert_counts(number, member, agents, timing, arrays, result),
            member.robot,
            member.world,
            member.route,
            member.faults,
        )
        for number, member in enumerate(members)
    )
    return replace(first, others=tuple(others)), arrays.trajectory[: result.rows]


def _create_members(team: Mapping[str, Scenario], mission: Mission) -> Iterator[Member]:
    for name, scenario in team.items():
        world = scenario.world[mission.world].at(mission.draws)
        yield create_member(name, scenario, world, mission)


def _open(members: Sequence[Member]) -> AbstractContextManager[Simulation]:
    """Open a simulation of the robots in the world of the first one."""
    first, simulator = members[0], members[0].scenario.simulator
    if len(members) > 1 and isinstance(simulator, TeamSimulator):
        placed = [PlacedRobot(each.robot, each.world.course.home) for each in members]
        return simulator.open_team(placed, first.world)
    return simulator.open(first.robot, first.world)


def _convert_counts(
    number: int,
    member: Member,
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
    start = 1 + before + number * len(AGENT_COLUMNS)
    end = start + member.columns
    # The first robot's columns follow the time, so that they need not be copied.
    columns = slice(end) if number == 0 else [0, *range(start, end)]
    layers = slice(agents.layers[number] + number, agents.layers[number + 1] + number + 1)
    return Rollout(
        ended=ENDINGS[ended],
        time=(result.ticks if cut_off else int(counts[END_TICK])) * tick,
        visited=int(counts[VISITED]),
        collisions=int(counts[COLLISIONS]),
        first_collision=first * tick if first >= 0 else math.nan,
        avoiding=_share_avoiding(member.scenario.controller.modes, arrays.decisions[layers]),
        trajectory=arrays.trajectory[:rows, columns],
    )


def _share_avoiding(modes: Sequence[str], decisions: Array) -> float:
    """Return the share of the decisions (1 + layers,) that the avoiding layers took."""
    counts = zip(modes, decisions[1:], strict=True)
    avoiding = sum(float(count) for mode, count in counts if mode == AVOIDING)
    return avoiding / max(float(decisions.sum()), 1.0)
