"""Describes a failure model for tables: whether its failures are drawn, and if none is due."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from evoros.base.rng import generator
from evoros.failure.protocol import Failure, Fault, SystematicFailure
from evoros.filter.protocol import Channels, Filter
from evoros.mission.fault_draws import describe_sensors

if TYPE_CHECKING:
    from collections.abc import Sequence

    from evoros.evolution.experiment import Experiment
    from evoros.mission.member import Member

MAX_CASES = 10_000
"""Cases of a systematic failure that are tried."""
_DRAWS, _CASES = 20, 50
"""Draws and cases of faults, of which the filters are listed."""


@dataclass(frozen=True)
class FailureContext:
    """How the failures of missions come about."""

    drawn: bool = True  # by random numbers, so that shares of missions estimate a probability
    always_intact: bool = False  # whether no sensor fails in any mission
    intact: tuple[int, ...] = ()  # trials of a systematic failure in which no sensor fails
    effects: Mapping[str, str] = field(default_factory=dict)
    """The change of readings by each effect, by its name: ``ends``, ``alters`` or ``grows``."""


class _Drawn(Exception):
    """A failure model has asked for random numbers."""


class _NoGenerator:
    """Stands for a generator, to see whether a failure model uses it."""

    def __getattr__(self, name: str) -> Any:
        raise _Drawn


def describe_failure(experiment: "Experiment", member: "Member") -> FailureContext:
    """Describe the failure model of an experiment, by a robot in the middle of its space."""
    middle = member.space.decode(np.full(member.space.size, 0.5))
    robot = member.with_design(middle).robot
    channels = describe_sensors(robot)
    failure = experiment.failure
    filters = sorted(_list_filters(failure, channels), key=lambda item: item.name)
    effects = {item.name.lower(): item.effect for item in filters}
    if isinstance(failure, SystematicFailure):
        known = min(failure.count_cases(channels.size), experiment.trials, MAX_CASES)
        intact = [n for n in range(known) if not _is_hit(failure.draw_case(channels, n))]
        return FailureContext(drawn=False, intact=tuple(intact), effects=effects)
    try:
        faults = failure.draw(channels, _NoGenerator())  # type: ignore[arg-type]
    except _Drawn:
        return FailureContext(effects=effects)
    return FailureContext(drawn=False, always_intact=not _is_hit(faults), effects=effects)


def _list_filters(failure: Failure, channels: Channels) -> Iterator[Filter]:
    """Yield the filters that a failure model states, and those of some faults that it draws."""
    stated = getattr(failure, "effect", None)
    if isinstance(stated, Filter):
        yield stated
    parts = getattr(failure, "failures", {})
    if isinstance(parts, Mapping):
        for part in parts.values():
            yield from _list_filters(part, channels)
    yield from (fault.filter for fault in _draw_some(failure, channels))


def _draw_some(failure: Failure, channels: Channels) -> Iterable[Fault]:
    if isinstance(failure, SystematicFailure):
        for trial in range(min(failure.count_cases(channels.size), _CASES)):
            yield from failure.draw_case(channels, trial)
        return
    for index in range(_DRAWS):
        yield from failure.draw(channels, generator("effects of faults", f"failure {index}"))


def _is_hit(faults: "Sequence[Fault]") -> bool:
    return any(np.isfinite(fault.onset).any() for fault in faults)
