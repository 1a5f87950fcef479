"""Finds live controllers that do not do the same twice, by a mission that is run twice."""

from collections.abc import Sequence
from concurrent.futures import CancelledError

import numpy as np

from evoros.base.arrays import Array
from evoros.dispatch.calls import pack, run_for_trajectory
from evoros.executor.protocol import Pool
from evoros.mission.mission import Mission
from evoros.mission.outcome import TIME
from evoros.mission.plan import describe
from evoros.mission.scenario import Scenario
from evoros.terminal.log import LOGGER


def report_repeatability(scenario: Scenario, mission: Mission, pool: Pool) -> None:
    """Let workers run a mission of live controllers twice, and log how the two differ.

    Rules and simulators of evoros do the same each time, so other controllers are left out.
    """
    if not scenario.is_live:
        return
    packed = pack(scenario)
    futures = [pool.submit(run_for_trajectory, packed, mission) for _ in range(2)]
    try:
        first, second = (future.result() for future in futures)
    except CancelledError:  # the pool was closed: the run is interrupted
        raise
    except Exception:  # the run will report the error of the same mission
        return
    difference = find_difference(
        first, second, scenario.name_columns(mission.design, mission.world)
    )
    if difference:
        LOGGER.warning(
            "controller: %s was run twice, and %s; nothing that depends on it can be repeated bit "
            "for bit; docs/ros.md lists what makes a controller differ",
            describe(mission),
            difference,
        )


def find_difference(first: Array, second: Array, columns: Sequence[str]) -> str:
    """Describe the first difference of two trajectories (rows, columns); empty if there is none."""
    rows = min(len(first), len(second))
    same = (first[:rows] == second[:rows]) | (np.isnan(first[:rows]) & np.isnan(second[:rows]))
    differing = np.flatnonzero(~same.all(axis=1))
    if len(differing):
        row = int(differing[0])
        column = int(np.flatnonzero(~same[row])[0])
        values = f"{columns[column]} {first[row, column]:g} and {second[row, column]:g}"
        return f"the two differ from tick {row} on, at {first[row, TIME]:g} s ({values})"
    if len(first) != len(second):
        times = f"{first[-1:, TIME].sum():g} and {second[-1:, TIME].sum():g} s"
        return f"the two differ from tick {rows} on, because they end at {times}"
    return ""
