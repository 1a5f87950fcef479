"""Detects live controllers that are not deterministic, by running one mission twice."""

from collections.abc import Sequence
from concurrent.futures import CancelledError

import numpy as np

from evoros.base.arrays import Array
from evoros.dispatch.calls import pack, run_for_trajectory
from evoros.executor.protocol import Pool
from evoros.mission.mission import TIME, Mission
from evoros.mission.plan import describe
from evoros.mission.scenario import Scenario
from evoros.terminal.log import LOGGER


def report_repeatability(scenario: Scenario, mission: Mission, pool: Pool) -> None:
    """Let workers run a mission with live controllers twice, and log the difference.

    Other controllers are left out, because rules and simulators of evoros are deterministic.
    """
    if not scenario.is_live:
        return
    packed = pack(scenario)
    futures = [pool.submit(run_for_trajectory, packed, mission) for _ in range(2)]
    try:
        first, second = (future.result() for future in futures)
    except CancelledError:  # the pool was closed, because the run is interrupted
        raise
    except Exception:  # the run will report the error
        return
    difference = find_difference(
        first, second, scenario.name_columns(mission.design, mission.world)
    )
    if difference:
        LOGGER.warning(
            "controller: %s was run twice, and %s; results that depend on the controller cannot be "
            "repeated exactly; plugins/ros/README.md lists possible causes",
            describe(mission),
            difference,
        )


def find_difference(first: Array, second: Array, columns: Sequence[str]) -> str:
    """Describe the first difference between two trajectories (rows, columns), or return ""."""
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
