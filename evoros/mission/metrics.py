"""Computes the metrics of a mission from its trajectory, alike for all simulators."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evoros.base.arrays import Array
from evoros.failure.protocol import Fault
from evoros.geometry.clearance import summarize_track
from evoros.mission.outcome import COMPLETED, ROBOT_COLUMNS, Outcome
from evoros.mission.participant import Participant
from evoros.sensor.protocol import add_prices
from evoros.world.model import World
from evoros.world.obstacles import outlines

X, Y, YAW, SPEED = map(ROBOT_COLUMNS.index, ("x_m", "y_m", "yaw_rad", "speed_mps"))


@dataclass(frozen=True)
class Rollout:
    """The result of the mission loop in SI units."""

    ended: str
    time: float  # [s]
    visited: int
    collisions: int
    first_collision: float  # [s], NaN: none
    avoiding: float  # share of the decisions, 0..1
    times: Array  # (rows,) [s]
    track: Array  # (rows, columns) of the robot


def measure(rollout: Rollout, participant: Participant, world: World) -> Outcome:
    """Compute the outcome of a robot's rollout in the world of its mission."""
    track, course, robot = rollout.track, participant.course, participant.robot
    areas = outlines(world, robot.height_m)
    points = np.array([*course.waypoints, course.home[:2]], dtype=np.float64)
    # Until the first collision every obstacle stands where the world has put it.
    untouched = int((~(rollout.times > rollout.first_collision)).sum())
    summary = summarize_track(track[:, X : YAW + 1], untouched, robot.outline, areas, points)
    end = track[-1, [X, Y]]
    failures = list_failures(participant.faults, rollout.time)
    return Outcome(
        ended=rollout.ended,
        reason="",
        completed=rollout.ended == COMPLETED,
        progress=compute_progress(end, rollout.visited, participant.route, course.acceptance_m),
        time_s=rollout.time,
        time_limit_s=course.time_limit_s,
        sensors=len(robot.mounts),
        price=add_prices(robot.mounts, robot.sensors),
        visited=rollout.visited,
        mean_speed_mps=summary.length / rollout.time if rollout.time > 0 else 0.0,
        max_speed_mps=float(np.abs(track[:, SPEED]).max()),
        distance_m=summary.length,
        least_waypoint_distances_m=summary.point_distances,
        collisions=rollout.collisions,
        first_collision_s=rollout.first_collision,
        avoiding=rollout.avoiding,
        least_clearance_m=summary.clearance if len(areas.rows) else float("nan"),
        failed_sensors=tuple(index for index, _, _ in failures),
        failed_at_s=tuple(onset for _, onset, _ in failures),
        failed_by=tuple(effect for _, _, effect in failures),
    )


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
