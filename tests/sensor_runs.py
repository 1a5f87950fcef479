"""Finished runs of designs that have many types of sensors."""

import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from helpers import finished_run

ALL = (
    "seed=1",
    "design=senses",
    "simulator=mujoco",
    "~world.far",
    "world.near.course.end_on_collision=false",
    "world.near.course.time_limit_s=25.0",
    "world.near.course.waypoints=[[-1.0,-7.8]]",  # behind a box
    "controller/avoidance=blind",
    "optimizer.generations=1",
    "optimizer.population_size=2",
    "optimizer.validation_trials=0",
    "failure.earliest_s=0.5",
    "failure.latest_s=6.0",
)
BUMPERS, IMU, INFRARED, LIDAR, ODOMETRY = (0, 1), 2, (3, 4), 5, 6
"""The numbers of the sensors."""

VIEWS = (
    "design=views",
    "simulator=planar",
    "controller/avoidance=blind",
    "optimizer.generations=1",
)
WIDE = {"beam": 27.0, "ray": 0.0, "infrared": 7.5, "zone": 27.0, "lidar": 200.0, "comb": 60.0}
"""The width [deg] of each sensor of ``design=views``, in its order."""


def finish_senses(folder: Path) -> Path:
    """Copy the run of ``ALL``, which is made once in each process of tests."""
    return finished_run(folder, *ALL)


def read_widths(described: Iterable[Any]) -> Iterator[float]:
    """The fields of view [deg] of all sensors in a description for programs."""
    for values in described:
        if isinstance(values, dict) and "field_of_view_rad" in values:
            yield math.degrees(values["field_of_view_rad"])
