"""Computes mission metrics from the trajectory, identically for all simulators."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from evoros.base.arrays import Array
from evoros.failure.protocol import AT_START, Fault, Trigger
from evoros.filter.protocol import READINGS
from evoros.geometry.clearance import summarize_track
from evoros.mission import inputs, mission
from evoros.mission.inputs import LoopResult
from evoros.mission.mission import ROBOT_COLUMNS, TIME, Outcome
from evoros.mission.participant import Participant
from evoros.mission.setup import Setup
from evoros.mission.triggers import BEGUN
from evoros.sensor.protocol import add_prices
from evoros.walkers.crowd import has_touched
from evoros.walkers.layout import REPORT_SIZE, REPORT_TOUCHED
from evoros.world.model import World
from evoros.world.standing import outlines

X, Y, YAW, SPEED, *_, TOUCHES = range(len(ROBOT_COLUMNS))
ENDINGS = {
    inputs.RUNNING: mission.MISSION_OVER,
    inputs.COMPLETED: mission.COMPLETED,
    inputs.COLLISION: mission.COLLISION,
    inputs.TIME_LIMIT: mission.TIME_LIMIT,
}
AVOIDING = "avoiding"


def measure(index: int, setup: Setup, result: LoopResult) -> Outcome:
    """Compute the outcome of the robot ``index``."""
    participant, faults = setup.robots[index].participant, setup.robots[index].faults
    counts, tick = setup.arrays.counts[:, index], setup.timing.tick
    ended, first = int(counts[inputs.ENDED]), int(counts[inputs.FIRST_COLLISION])
    cut_off = ended == inputs.RUNNING  # the mission ended while this robot was still running
    time = (result.ticks if cut_off else int(counts[inputs.END_TICK])) * tick
    rows = setup.arrays.trajectory[: result.rows if cut_off else int(counts[inputs.END_ROW]) + 1]
    start = 1 + setup.agents.readings[index] + setup.agents.estimates[index]
    start += index * len(ROBOT_COLUMNS)
    track = rows[:, start : start + len(ROBOT_COLUMNS)]
    first_collision = first * tick if first >= 0 else math.nan
    visited, robot = int(counts[inputs.VISITED]), participant.robot
    course, end = participant.course, track[-1, [X, Y]]
    # Obstacles stay at their initial poses until the first collision.
    untouched = int((~(rows[:, TIME] > first_collision)).sum())
    triggers, clocks = setup.arrays.triggers, setup.clocks[index].items()
    begun = {AT_START: 0.0} | {one: float(triggers[clock - 1, BEGUN]) for one, clock in clocks}
    failures = list_failures(faults, time, begun)
    parts = list_part_failures(faults, time, begun)
    return Outcome(
        ended=ENDINGS[ended],
        reason="",
        completed=ended == inputs.COMPLETED,
        progress=compute_progress(end, visited, participant.route, course.acceptance_m),
        time_s=time,
        time_limit_s=course.time_limit_s,
        sensors=len(robot.mounts),
        price=add_prices(robot.mounts, robot.sensors),
        visited=visited,
        collisions=int(counts[inputs.COLLISIONS]),
        first_collision_s=first_collision,
        avoiding=_share_avoiding(index, setup),
        failed_sensors=tuple(sensor for sensor, _, _ in failures),
        failed_at_s=tuple(onset for _, onset, _ in failures),
        failed_by=tuple(effect for _, _, effect in failures),
        failed_parts=tuple(part for _, part, _ in parts),
        parts_failed_at_s=tuple(onset for onset, _, _ in parts),
        parts_failed_by=tuple(effect for _, _, effect in parts),
        touched_walkers=_list_touched(index, rows[-1], setup.world),
        shortest_m=setup.world.shortest_m,
        **_measure_track(track, time, untouched, participant, setup.world),
    )


def _measure_track(
    track: Array, time: float, untouched: int, participant: Participant, world: World
) -> dict[str, Any]:
    """Measure a path that took ``time`` [s]; the first ``untouched`` rows precede any collision."""
    course, robot = participant.course, participant.robot
    areas = outlines(world, robot.height_m)
    points = np.array([*course.waypoints, course.home[:2]], dtype=np.float64)
    way = track[:, [X, Y, YAW, TOUCHES]]
    summary = summarize_track(way, untouched, robot.outline, areas, points)
    return {
        "mean_speed_mps": summary.length / time if time > 0 else 0.0,
        "max_speed_mps": float(np.abs(track[:, SPEED]).max()),
        "distance_m": summary.length,
        "least_waypoint_distances_m": summary.point_distances,
        "least_clearance_m": summary.clearance if len(areas.rows) else math.nan,
    }


def _list_touched(index: int, row: Array, world: World) -> tuple[str, ...] | None:
    if world.crowd is None:
        return None
    names = world.crowd.names
    reports = row[len(row) - REPORT_SIZE * len(names) :].reshape(-1, REPORT_SIZE)
    touched = zip(names, reports[:, REPORT_TOUCHED].tolist(), strict=True)
    return tuple(name for name, report in touched if has_touched(report, index))


def _share_avoiding(index: int, setup: Setup) -> float:
    first, end = setup.agents.layers[index : index + 2]
    decisions = setup.arrays.decisions[first + index : end + index + 1]
    modes = setup.robots[index].participant.member.controller.modes
    counts = zip(modes, decisions[1:], strict=True)
    avoiding = sum(float(count) for mode, count in counts if mode == AVOIDING)
    return avoiding / max(float(decisions.sum()), 1.0)


def compute_progress(position: Array, visited: int, route: Array, acceptance: float) -> float:
    """Return the completed fraction of the mission, 0..1.

    Each of the n waypoints adds 1/n once reached. The next waypoint adds 1/n divided by the
    distance [m] to its acceptance circle, but at most 1/n. The result is at most 0.99 until all
    waypoints are reached.
    """
    if visited == len(route):
        return 1.0
    distance = float(np.sqrt(((route[visited] - position) ** 2).sum())) - acceptance
    return min(0.99, (visited + 1.0 / max(distance, 1.0)) / len(route))


Begun = Mapping[Trigger, float]  # event time [s] of each trigger, infinity before the event


def list_failures(
    faults: Sequence[Fault], end: float, begun: Begun = MappingProxyType({AT_START: 0.0})
) -> list[tuple[int, float, str]]:
    """List (sensor, onset [s], effect) for each sensor that fails no later than ``end`` [s]."""
    return sorted(
        (index, float(begun[fault.trigger] + onset), fault.effect)
        for fault in faults
        if fault.signal == READINGS
        for index, onset in enumerate(fault.onset)
        if begun[fault.trigger] + onset <= end
    )


def list_part_failures(
    faults: Sequence[Fault], end: float, begun: Begun
) -> list[tuple[float, str, str]]:
    """List (onset [s], part, effect) for each other part that fails no later than ``end`` [s]."""
    of_parts = [fault for fault in faults if fault.signal != READINGS]
    times = [(begun[fault.trigger] + float(fault.onset[0]), fault) for fault in of_parts]
    return sorted((onset, fault.part, fault.effect) for onset, fault in times if onset <= end)
