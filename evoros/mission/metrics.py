"""Computes the metrics of a mission from its trajectory, once for all simulators."""

from dataclasses import dataclass

import numpy as np

from evoros.base.arrays import Array
from evoros.failure.protocol import Fault
from evoros.geometry.clearance import summarize_track
from evoros.mission.outcome import AT_X, AT_Y, COMPLETED, HEADING, PACE, TIME, Outcome
from evoros.robot.model import Robot
from evoros.world.model import World
from evoros.world.obstacles import outlines


@dataclass(frozen=True)
class Rollout:
    """What the mission loop leaves: how it ended, what it counted, and its trajectory."""

    ended: str
    time: float  # [s]
    visited: int
    collisions: int
    first_collision: float  # [s], NaN: none
    avoiding: float  # share of the decisions
    trajectory: Array  # (rows, len(TRAJECTORY) + sensors)


def measure(
    flight: Rollout,
    robot: Robot,
    world: World,
    route: Array,
    faults: tuple[Fault, ...],
) -> Outcome:
    """The metrics of a flight along ``route`` (n, 2)."""
    track = flight.trajectory
    course, areas = world.course, outlines(world, robot.height_m)
    places = np.array([*course.waypoints, course.home[:2]], dtype=np.float64)
    # Until the first collision every obstacle stands where the world has put it.
    untouched = int((~(track[:, TIME] > flight.first_collision)).sum())
    summary = summarize_track(track[:, AT_X : HEADING + 1], untouched, robot.outline, areas, places)
    hurt = failed_sensors(faults, flight.time)
    return Outcome(
        ended=flight.ended,
        reason="",
        completed=flight.ended == COMPLETED,
        progress=progress(
            track[-1, [AT_X, AT_Y]], flight.visited, route, world.course.acceptance_m
        ),
        time_s=flight.time,
        time_limit_s=world.course.time_limit_s,
        sensors=len(robot.mounts),
        visited=flight.visited,
        mean_speed_mps=summary.length / flight.time if flight.time > 0 else 0.0,
        max_speed_mps=float(np.abs(track[:, PACE]).max()),
        distance_m=summary.length,
        least_waypoint_distances_m=summary.point_distances,
        collisions=flight.collisions,
        first_collision_s=flight.first_collision,
        avoiding=flight.avoiding,
        least_clearance_m=summary.clearance if len(areas.rows) else float("nan"),
        failed_sensors=tuple(index for index, _, _ in hurt),
        failed_at_s=tuple(onset for _, onset, _ in hurt),
        failed_by=tuple(effect for _, _, effect in hurt),
    )


def progress(position: Array, visited: int, route: Array, acceptance: float) -> float:
    """Share of the mission that is done, 0..1.

    Each of the n waypoints counts 1/n; the one that is being approached counts 1/n divided by
    the distance [m] that is left to its circle, at most 1/n; at most 0.99 until all are reached
    (the study's ``10 visited + 10 / max(distance - 1, 1)`` percent for its ten waypoints).
    """
    if visited == len(route):
        return 1.0
    left = float(np.sqrt(((route[visited] - position) ** 2).sum())) - acceptance
    return min(0.99, (visited + 1.0 / max(left, 1.0)) / len(route))


def failed_sensors(faults: tuple[Fault, ...], end: float) -> list[tuple[int, float, str]]:
    """(sensor, onset [s], effect) of every fault that began before the mission's end."""
    return sorted(
        (index, float(onset), fault.effect)
        for fault in faults
        for index, onset in enumerate(fault.onset)
        if onset <= end
    )
