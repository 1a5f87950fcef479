"""Runs one mission, from a design to its outcome."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError, LaunchError, SimulationError
from evoros.mission import outcome
from evoros.mission.compiled_loop import prepare
from evoros.mission.live_layers import open_layers
from evoros.mission.loop import Loop, LoopInputs
from evoros.mission.member import Member
from evoros.mission.metrics import measure
from evoros.mission.mission import Mission
from evoros.mission.outcome import Outcome, Outcomes
from evoros.mission.participant import enter
from evoros.mission.scenario import Scenario
from evoros.mission.start import collect_inputs, start
from evoros.simulator.protocol import PlacedRobot

Prepare = Callable[[LoopInputs], tuple[Loop, LoopInputs]]
"""Chooses the loop for the inputs, and adapts these to it."""


def run_mission(
    scenario: Scenario, mission: Mission, prepare: Prepare = prepare
) -> tuple[Outcomes, Array]:
    """Run a mission and return its outcomes and its trajectory, (rows, columns).

    ``Scenario.name_columns`` names the columns. A failure of the simulation is an outcome, because
    it would recur. So are evolved values that a part refuses, because other designs can still be
    evaluated.

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
        Outcome.failure(ended, reason, limit, sensors, price)
        for sensors, price in scenario.count_sensors(mission.design)
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
    placed = [PlacedRobot(item.robot, item.course.home) for item in participants]
    with ExitStack() as stack:
        layers = [stack.enter_context(open_layers(participant)) for participant in participants]
        started = start(scenario, participants, layers)
        simulation = stack.enter_context(scenario.simulator.open(placed, world))
        loop, inputs = prepare(collect_inputs(simulation, started.stages))
        result = loop(inputs, started.agents, started.timing, started.arrays)
    if not result.finite:
        time = result.ticks * started.timing.tick
        raise SimulationError(f"the state is not finite after {time:g} s")
    outcomes = tuple(
        measure(index, participant, started, result, world)
        for index, participant in enumerate(participants)
    )
    return outcomes, started.arrays.trajectory[: result.rows]
