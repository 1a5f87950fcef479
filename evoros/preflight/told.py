"""Finds designs with more sensors than their controller can be told."""

from collections.abc import Iterator

from evoros.controller.protocol import LimitedController
from evoros.preflight.subject import Subject


def check_told(subject: Subject) -> Iterator[str]:
    """Yield a warning for each controller that is told fewer sensors than designs may have."""
    number = subject.design.max_number * (2 if subject.design.mirrored else 1)
    controllers = {
        "controller": subject.controller,
        "confirmation.controller": subject.confirming.members[0].controller,
    }
    told: dict[int, str] = {}
    for key, controller in controllers.items():
        if isinstance(controller, LimitedController) and controller.told_sensors < number:
            told.setdefault(controller.told_sensors, key)
    for limit, key in told.items():
        yield (
            f"{key}: {limit} sensors are told to its program, the first of each design, and "
            f"designs have up to {number}; its layers see all"
        )
