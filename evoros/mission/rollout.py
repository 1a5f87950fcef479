"""Runs one mission, from a design to its outcome."""

import math
from collections.abc import Generator
from typing import TypeAlias

import numpy as np

from evoros.base.arrays import Array
from evoros.base.errors import InputError, LaunchError, SimulationError
from evoros.mission import outcome
from evoros.mission.compiled_loop import prepare
from evoros.mission.inputs import Prepare
from evoros.mission.mission import Mission
from evoros.mission.opened import OpenMission, open_mission
from evoros.mission.outcome import Outcome, Outcomes
from evoros.mission.scenario import Scenario

Rollout: TypeAlias = tuple[Outcomes, Array]
"""The outcomes of a mission and its trajectory, (rows, columns); ``Scenario.name_columns`` names
the columns."""


def run_mission(scenario: Scenario, mission: Mission, prepare: Prepare = prepare) -> Rollout:
    """Run a mission.

    A failure of the simulation is an outcome, because it would recur. So are evolved values that a
    part refuses, because other designs can still be evaluated.

    Raises:
        InputError: a part refuses to start for another reason than an evolved value.
        PilotLost: a controller outside of this process ended or did not answer.
    """
    return finish(roll_out(scenario, mission, prepare))


def finish(rollout: Generator[OpenMission, None, Rollout]) -> Rollout:
    """Run a mission that ``roll_out`` has opened, or opens now."""
    while True:
        try:
            next(rollout)
        except StopIteration as end:
            result: Rollout = end.value
            return result


def roll_out(
    scenario: Scenario, mission: Mission, prepare: Prepare
) -> Generator[OpenMission, None, Rollout]:
    """Open a mission and yield it; then run it and return what ``run_mission`` does.

    A mission that cannot be opened is not yielded.
    """
    try:
        members = scenario.equip(mission.design)
    except InputError as error:
        ended, reason = outcome.REFUSED, str(error)
    else:
        try:
            with open_mission(scenario, members, mission, prepare) as opened:
                yield opened
                opened.run()
            return opened.outcomes(), opened.trajectory
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
    touched = () if scenario.any_walkers else None
    shortest = math.nan if scenario.states_shortest else None
    return tuple(
        Outcome.failure(ended, reason, limit, sensors, price, touched, shortest)
        for sensors, price in scenario.count_sensors(mission.design)
    )


def empty_trajectory(scenario: Scenario, mission: Mission) -> Array:
    """Create the trajectory of a mission that could not be run, with all columns and no row."""
    return np.empty((0, len(scenario.name_columns(mission.design, mission.world))))
