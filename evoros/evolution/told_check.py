"""Finds designs with more sensors than their controller can be told."""

from collections.abc import Iterator

from evoros.controller.protocol import LimitedController
from evoros.evolution.experiment import Experiment


def check_told(experiment: Experiment) -> Iterator[str]:
    """Yield a warning for each controller that is told fewer sensors than designs may have."""
    number = experiment.design.max_number * (2 if experiment.design.mirrored else 1)
    scenarios = {
        "controller": experiment.scenario,
        "confirmation.controller": experiment.confirming,
    }
    told: dict[int, str] = {}
    for key, scenario in scenarios.items():
        controller = scenario.controller
        if isinstance(controller, LimitedController) and controller.told_sensors < number:
            told.setdefault(controller.told_sensors, key)
    for limit, key in told.items():
        yield (
            f"{key}: {limit} sensors are told to its program, the first of each design, and "
            f"designs have up to {number}; its layers see all"
        )
