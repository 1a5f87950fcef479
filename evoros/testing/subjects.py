"""An example robot, world and outcomes for testing parts."""

from dataclasses import replace
from functools import cache

import numpy as np

from evoros.config.compose import compose
from evoros.design.design import Design
from evoros.evolution.experiment import Experiment
from evoros.mission.mission import COLLISION, COMPLETED, LOST, REFUSED, TIME_LIMIT, Outcome
from evoros.robot.model import Robot
from evoros.world.model import World

TIME_LIMIT_S = 100.0


@cache
def example_experiment() -> Experiment:
    """Return the experiment of the default configuration, with the planar simulator."""
    return compose(["simulator=planar", "executor=serial"]).build()


@cache
def example_design(share: float = 0.6) -> Design:
    """Return a design in the example's space with equal genes."""
    space = example_experiment().space
    return space.decode(np.full(space.size, share))


@cache
def example_robot(share: float = 0.6) -> Robot:
    """Return the example's robot with the sensors of a design."""
    return example_experiment().members[0].with_design(example_design(share)).robot


def example_world(name: str = "boxes") -> World:
    """Return a world of the example experiment."""
    return example_experiment().world[name]


def example_outcome(progress: float = 0.0, ended: str = TIME_LIMIT) -> Outcome:
    """Return an outcome with the given progress, in a world without obstacles."""
    blank = Outcome.failure(ended, "", TIME_LIMIT_S, sensors=3, price=30.0)
    return replace(
        blank,
        completed=ended == COMPLETED,
        progress=progress,
        time_s=60.0,
        mean_speed_mps=0.3,
        max_speed_mps=0.4,
        distance_m=18.0,
        least_waypoint_distances_m=(0.2, 0.1),
        shortest_m=20.0,
        avoiding=0.25,
    )


def list_trials() -> list[list[Outcome]]:
    """Return trials of two missions, which end in all possible ways except ``NOT_RUN``."""
    near = replace(example_outcome(0.4, COLLISION), collisions=1, first_collision_s=20.0)
    return [
        [example_outcome(0.0), example_outcome(0.0)],
        [example_outcome(0.5), replace(near, least_clearance_m=0.0)],
        [example_outcome(1.0, COMPLETED), replace(example_outcome(0.9), least_clearance_m=0.3)],
    ]


def list_lost_trials() -> list[list[Outcome]]:
    """Return trials in which one of the missions could not run."""
    lost = (Outcome.failure(ended, "why", TIME_LIMIT_S, 3, price=30.0) for ended in (LOST, REFUSED))
    return [[outcome, example_outcome(1.0, COMPLETED)] for outcome in lost]
