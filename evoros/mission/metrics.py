"""Computes the metrics of a mission from its trajectory, alike for all simulators."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from evoros.base.arrays import Array
from evoros.failure.protocol import Fault
from evoros.geometry.clearance import summarize_track
from evoros.mission import loop, outcome
from evoros.mission.loop import Agents, LoopResult
from evoros.mission.outcome import ROBOT_COLUMNS, TIME, Outcome
from evoros.mission.participant import Participant
from evoros.mission.start import Started
from evoros.sensor.protocol import add_prices
from evoros.walkers.layout import REPORT_SIZE, REPORT_TOUCHED
from evoros.walkers.reports import has_touched
from evoros.world.model import World
from evoros.world.obstacles import outlines

X, Y, YAW, SPEED = map(ROBOT_COLUMNS.index, ("x_m", "y_m", "yaw_rad", "speed_mps"))
ENDINGS = {
    loop.RUNNING: outcome.MISSION_OVER,
    loop.COMPLETED: outcome.COMPLETED,
    loop.COLLISION: outcome.COLLISION,
    loop.TIME_LIMIT: outcome.TIME_LIMIT,
}
AVOIDING = "avoiding"


def measure(
    index: int, participant: Participant, started: Started, result: LoopResult, world: World
) -> Outcome:
    """Compute the outcome of the robot ``index`` in the world of its mission."""
    counts, tick = started.arrays.counts[:, index], started.timing.tick
    ended, first = int(counts[loop.ENDED]), int(counts[loop.FIRST_COLLISION])
    cut_off = ended == loop.RUNNING  # the mission did not wait for it
    time = (result.ticks if cut_off else int(counts[loop.END_TICK])) * tick
    rows = started.arrays.trajectory[: result.rows if cut_off else int(counts[loop.END_ROW]) + 1]
    track = rows[:, _find_columns(started.agents, index)]
    first_collision = first * tick if first >= 0 else math.nan
    visited, robot = int(counts[loop.VISITED]), participant.robot
    course, end = participant.course, track[-1, [X, Y]]
    # Until the first collision every obstacle stands where the world has put it.
    untouched = int((~(rows[:, TIME] > first_collision)).sum())
    failures = list_failures(participant.faults, time)
    return Outcome(
        ended=ENDINGS[ended],
        reason="",
        completed=ended == loop.COMPLETED,
        progress=compute_progress(end, visited, participant.route, course.acceptance_m),
        time_s=time,
        time_limit_s=course.time_limit_s,
        sensors=len(robot.mounts),
        price=add_prices(robot.mounts, robot.sensors),
        visited=visited,
        collisions=int(counts[loop.COLLISIONS]),
        first_collision_s=first_collision,
        avoiding=_share_avoiding(index, participant, started),
        failed_sensors=tuple(sensor for sensor, _, _ in failures),
        failed_at_s=tuple(onset for _, onset, _ in failures),
        failed_by=tuple(effect for _, _, effect in failures),
        touched_walkers=_list_touched(index, rows[-1], world),
        **_measure_track(track, time, untouched, participant, world),
    )


def _measure_track(
    track: Array, time: float, untouched: int, participant: Participant, world: World
) -> dict[str, Any]:
    """Measure the way of a robot in ``time`` [s]; its first rows are ``untouched`` by contacts."""
    course, robot = participant.course, participant.robot
    areas = outlines(world, robot.height_m)
    points = np.array([*course.waypoints, course.home[:2]], dtype=np.float64)
    summary = summarize_track(track[:, X : YAW + 1], untouched, robot.outline, areas, points)
    return {
        "mean_speed_mps": summary.length / time if time > 0 else 0.0,
        "max_speed_mps": float(np.abs(track[:, SPEED]).max()),
        "distance_m": summary.length,
        "least_waypoint_distances_m": summary.point_distances,
        "least_clearance_m": summary.clearance if len(areas.rows) else math.nan,
    }


def _list_touched(index: int, row: Array, world: World) -> tuple[str, ...] | None:
    """Name the walkers that a robot has touched up to a row of the trajectory."""
    if world.crowd is None:
        return None
    names = world.crowd.names
    reports = row[len(row) - REPORT_SIZE * len(names) :].reshape(-1, REPORT_SIZE)
    touched = zip(names, reports[:, REPORT_TOUCHED].tolist(), strict=True)
    return tuple(name for name, report in touched if has_touched(report, index))


def _find_columns(agents: Agents, index: int) -> slice:
    """Return where a trajectory has the ``ROBOT_COLUMNS`` of a robot."""
    first = 1 + agents.readings[index] + agents.estimates[index] + index * len(ROBOT_COLUMNS)
    return slice(first, first + len(ROBOT_COLUMNS))


def _share_avoiding(index: int, participant: Participant, started: Started) -> float:
    """Return the share of the robot's decisions that its avoiding layers took."""
    first, end = started.agents.layers[index : index + 2]
    decisions = started.arrays.decisions[first + index : end + index + 1]
    counts = zip(participant.member.controller.modes, decisions[1:], strict=True)
    avoiding = sum(float(count) for mode, count in counts if mode == AVOIDING)
    return avoiding / max(float(decisions.sum()), 1.0)


def compute_progress(position: Array, visited: int, route: Array, acceptance: float) -> float:
    """Compute the share of the mission that is completed, 0..1.

    Each of the n waypoints that is reached counts 1/n. The next one counts 1/n divided by the
    distance [m] to its circle, at most 1/n. The progress is at most 0.99 until all are reached.
    This is the study's ``10 visited + 10 / max(distance - 1, 1)`` percent for ten waypoints.
    """
    if visited == len(route):
        return 1.0
    distance = float(np.sqrt(((route[visited] - position) ** 2).sum())) - acceptance
    return min(0.99, (visited + 1.0 / max(distance, 1.0)) / len(route))


def list_failures(faults: Sequence[Fault], end: float) -> list[tuple[int, float, str]]:
    """List the sensor, onset [s] and effect of every fault that begins until ``end`` [s]."""
    return sorted(
        (index, float(onset), fault.effect)
        for fault in faults
        for index, onset in enumerate(fault.onset)
        if onset <= end
    )
