"""What one mission measured: its trajectory, and the metrics computed from it.

The metrics are computed after the mission, from the trajectory alone, so that they exist once
for every simulator.
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from evoros.plane.scene import outlines
from evoros.plane.track import survey
from evoros.robot import Robot
from evoros.types import Array, Fault
from evoros.world import World

# How a mission ended.
COMPLETED, COLLISION, TIME_LIMIT = "completed", "collision", "time_limit"
SIMULATION_FAILURE, LOST, REFUSED = "simulation_failure", "lost", "refused"
NOT_FLOWN = (SIMULATION_FAILURE, LOST, REFUSED)

# Columns of a trajectory; the readings of the sensors [m] follow, NaN where silent.
TRAJECTORY = (
    "time_s",
    "x_m",
    "y_m",
    "yaw_rad",
    "speed_mps",
    "steering_rad",
    "mode",
    "visited",
    "contact",
)
TIME, AT_X, AT_Y, HEADING, PACE, STEER, MODE, VISITED, TOUCHES = range(len(TRAJECTORY))


@dataclass(frozen=True)
class Outcome:
    """The metrics of one mission, in the order of the columns of ``missions.csv``.

    A mission whose simulation failed, whose worker was lost, or whose design some part refused,
    has done nothing: progress 0, and NaN where nothing was measured.
    """

    ended: str  # completed, collision, time_limit, or one of NOT_FLOWN
    reason: str  # of a failure; otherwise empty
    completed: bool
    progress: float  # 0..1
    time_s: float
    time_limit_s: float
    sensors: int
    visited: int  # waypoints reached, in order
    mean_speed_mps: float
    max_speed_mps: float
    distance_m: float
    least_waypoint_distances_m: tuple[float, ...]  # to each distinct waypoint, home last
    collisions: int
    first_collision_s: float  # NaN: none
    avoiding: float  # share of time, 0..1
    least_clearance_m: float
    failed_sensors: tuple[int, ...]
    failed_at_s: tuple[float, ...]  # NaN-free, in the order of failed_sensors
    failed_by: tuple[str, ...]  # the effect: silence, stuck ...

    @classmethod
    def failure(cls, ended: str, reason: str, time_limit: float, sensors: int) -> "Outcome":
        """Nothing done, because of ``reason``."""
        empty: dict[str, Any] = {
            "ended": ended,
            "reason": " ".join(reason.split()),
            "time_limit_s": time_limit,
            "sensors": sensors,
        }
        blank: dict[Any, Any] = {bool: False, int: 0, float: float("nan"), str: ""}
        for field in fields(cls):
            empty.setdefault(field.name, blank.get(field.type, ()))
        return cls(**(empty | {"progress": 0.0, "time_s": 0.0, "distance_m": 0.0}))


@dataclass(frozen=True)
class Flight:
    """What the mission loop leaves: how it ended, what it counted, and its trajectory."""

    ended: str
    time: float  # [s]
    visited: int
    collisions: int
    first_collision: float  # [s], NaN: none
    avoiding: float  # share of the decisions
    trajectory: Array  # (rows, len(TRAJECTORY) + sensors)


def measure(
    flight: Flight,
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
    found = survey(track[:, AT_X : HEADING + 1], untouched, robot.outline, areas, places)
    hurt = failures(faults, flight.time)
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
        mean_speed_mps=found.distance / flight.time if flight.time > 0 else 0.0,
        max_speed_mps=float(np.abs(track[:, PACE]).max()),
        distance_m=found.distance,
        least_waypoint_distances_m=found.places,
        collisions=flight.collisions,
        first_collision_s=flight.first_collision,
        avoiding=flight.avoiding,
        least_clearance_m=found.clearance if len(areas.rows) else float("nan"),
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


def failures(faults: tuple[Fault, ...], end: float) -> list[tuple[int, float, str]]:
    """(sensor, onset [s], effect) of every fault that began before the mission's end."""
    return sorted(
        (index, float(onset), type(fault.filter).__name__.lower())
        for fault in faults
        for index, onset in enumerate(fault.onset)
        if onset <= end
    )
