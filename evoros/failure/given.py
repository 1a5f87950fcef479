"""Failures of given sensors at given times, for example to repeat a known case."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

from numpy.random import Generator

from evoros.base.checks import NOT_NEGATIVE, WHOLE, Rule, checked, invalid
from evoros.base.errors import InputError
from evoros.failure.protocol import Case, Failure, Fault, make_faults
from evoros.filter.protocol import A_FILTER, Channels, Filter
from evoros.filter.silence import Silence

SENSORS = Rule(
    "a list of distinct non-negative integers",
    lambda v: isinstance(v, list | tuple) and all(map(WHOLE.holds, v)) and len(set(v)) == len(v),
)
TIMES = Rule(
    "a non-negative number, or a list of these",
    lambda v: all(map(NOT_NEGATIVE.holds, v if isinstance(v, list | tuple) else [v])),
)


@dataclass(frozen=True)
@checked
class GivenFailure(Failure):
    """Failures of the same sensors in all missions, together or each at a given time."""

    sensors: Annotated[Sequence[int], SENSORS] = ()
    time_s: Annotated[float | Sequence[float], TIMES] = 0.0  # one time, or one per sensor
    effect: Annotated[Filter, A_FILTER] = field(default_factory=Silence)  # applied to the readings

    def __post_init__(self) -> None:
        if isinstance(self.time_s, list | tuple) and len(self.time_s) != len(self.sensors):
            rule = f"must be one number, or one for each of the {len(self.sensors)} sensors"
            raise invalid(self, "time_s", self.time_s, rule)

    @property
    def case(self) -> Case:
        """The case of all missions."""
        if isinstance(self.time_s, int | float):
            return Case.of((sensor, self.time_s) for sensor in self.sensors)
        return Case.of(zip(self.sensors, self.time_s, strict=True))

    def draw(self, channels: Channels, rng: Generator) -> tuple[Fault, ...]:
        beyond = [sensor for sensor in self.sensors if sensor >= channels.size]
        if beyond:
            raise InputError(
                "failure.sensors: must be indices of the robot's sensors, 0 to "
                f"{channels.size - 1}, not {beyond[0]}; remove that index, or give designs with "
                "more sensors"
            )
        return make_faults(self, self.case, channels.size)
