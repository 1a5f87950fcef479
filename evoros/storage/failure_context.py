"""Describes a failure model for tables: whether its failures are drawn, and where none is due."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from evoros.failure.protocol import Fault, SystematicFailure
from evoros.mission.pipeline import describe_sensors
from evoros.storage.fault_effects import describe_effects

if TYPE_CHECKING:
    from collections.abc import Sequence

    from evoros.evolution.experiment import Experiment

MOST_CASES = 10_000
"""Cases of a systematic failure that are looked at."""


@dataclass(frozen=True)
class FailureContext:
    """How the failures of missions come about."""

    drawn: bool = True  # by random numbers, so that shares of missions estimate a probability
    always_intact: bool = False  # whether no sensor fails in any mission
    intact: tuple[int, ...] = ()  # trials of a systematic failure in which no sensor fails
    effects: Mapping[str, str] = field(default_factory=dict)
    """What each effect does to readings, by its name: ``ends``, ``alters`` or ``grows``."""


class _Drawn(Exception):
    """A failure model has asked for random numbers."""


class _NoGenerator:
    """Stands for a generator, to see whether a failure model uses it."""

    def __getattr__(self, name: str) -> Any:
        raise _Drawn


def describe_failure(experiment: "Experiment") -> FailureContext:
    """Describe the failure model of an experiment, by a design in the middle of its space."""
    space = experiment.own_space
    middle = space.decode(np.full(space.size, 0.5))
    robot = experiment.members[""].scenario.with_design(middle).robot
    channels = describe_sensors(robot)
    failure = experiment.failure
    effects = describe_effects(failure, robot, channels)
    if isinstance(failure, SystematicFailure):
        known = min(failure.count_cases(channels.size), experiment.trials, MOST_CASES)
        trials = range(known)
        intact = [n for n in trials if not _is_hit(failure.draw_case(channels, n))]
        return FailureContext(drawn=False, intact=tuple(intact), effects=effects)
    try:
        faults = failure.draw(channels, _NoGenerator())  # type: ignore[arg-type]
    except _Drawn:
        return FailureContext(effects=effects)
    return FailureContext(drawn=False, always_intact=not _is_hit(faults), effects=effects)


def _is_hit(faults: "Sequence[Fault]") -> bool:
    return any(np.isfinite(fault.onset).any() for fault in faults)
