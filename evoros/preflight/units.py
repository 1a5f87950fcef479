"""Finds values that are probably in another unit, and more workers than cores."""

import math
from collections.abc import Iterator

from evoros.evolution.experiment import Experiment
from evoros.executor.processes import Processes, available_cores
from evoros.preflight.subject import list_subjects

MAX_RANGE_M = 1000.0
"""Sensors of mobile robots see less far; 6000 is likely to be in millimetres."""
MAX_WORKERS_PER_CORE = 4


def check_units(experiment: Experiment) -> Iterator[str]:
    """Yield a warning for each angle that is more than a turn, and each range of kilometres."""
    for name, world in experiment.world.items():
        yaw = world.course.home_yaw_rad
        if abs(yaw) > 2 * math.pi:
            yield (
                f"world.{name}.course.home_yaw_rad: {yaw:g} rad is more than a turn, probably "
                f"degrees; in radians it is {math.radians(yaw):.4g}"
            )
    for subject in list_subjects(experiment):
        for name, sensor in subject.design.sensors.items():
            reach = getattr(sensor, "range_max_m", 0.0)
            if reach > MAX_RANGE_M:
                yield (
                    f"{subject.key}design.sensors.{name}.range_max_m: {reach:g} m is more than "
                    f"{MAX_RANGE_M:g} m, probably millimetres; in metres it is {reach / 1000:g}"
                )


def check_workers(experiment: Experiment) -> Iterator[str]:
    """Yield a warning if the workers are many more than the cores."""
    executor, cores = experiment.executor, available_cores()
    limit = MAX_WORKERS_PER_CORE * cores
    if isinstance(executor, Processes) and executor.workers > limit:
        yield (
            f"executor.workers: {executor.workers} workers share {cores} cores, and each takes "
            f"memory; leave it out for one on each core"
        )
