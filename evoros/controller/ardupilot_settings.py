"""The values of the controller that starts an ArduPilot, checked."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated

from evoros.base.checks import (
    FLAG,
    POSITIVE,
    TEXT,
    Rule,
    checked,
    instance_of,
    invalid,
    is_number,
    mapping_of,
    sequence_of,
)
from evoros.controller.line_controller import split_command
from evoros.controller.protocol import LOCALIZATION, Layer, Localizer

MAX_PERIOD_S = 0.02
PERIOD = Rule(
    f"a number greater than 0 and at most {MAX_PERIOD_S}, because ArduPilot does not arm with "
    f"fewer than 50 states a second",
    lambda v: is_number(v) and 0 < v <= MAX_PERIOD_S + 1e-12,
)
PARAMETERS = Rule(
    "a mapping from ArduPilot's names, such as WP_SPEED, to numbers",
    lambda v: (
        isinstance(v, Mapping)
        and all(re.fullmatch(r"[A-Z][A-Z0-9_]{0,15}", str(name)) for name in v)
        and all(map(is_number, v.values()))
    ),
)


@dataclass(frozen=True, kw_only=True)
@checked
class ArduPilotSettings:
    """The values of an ``ArduPilot``, checked to fit together."""

    binary: Annotated[str, TEXT]
    avoidance: Annotated[Layer, instance_of(Layer, "a layer of a controller")]
    period_s: Annotated[float, PERIOD] = MAX_PERIOD_S  # between two states
    avoidance_period_s: Annotated[float, POSITIVE] = 0.1
    localization: Annotated[Mapping[str, Localizer], LOCALIZATION] = field(default_factory=dict)
    parameters: Annotated[Mapping[str, float], PARAMETERS] = field(default_factory=dict)
    arguments: Annotated[Sequence[str], sequence_of(str, "texts")] = ()
    environment: Annotated[Mapping[str, str], mapping_of(str, "texts")] = field(
        default_factory=dict
    )
    warm_up_s: Annotated[float, POSITIVE] = 60.0  # simulated, until it is in AUTO
    start_limit_s: Annotated[float, POSITIVE] = 30.0  # wall clock
    answer_limit_s: Annotated[float, POSITIVE] = 10.0  # wall clock
    isolate: Annotated[bool, FLAG] = True
    share_core: Annotated[bool, FLAG] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "binary", split_command([self.binary])[0])
        if self.localization:
            raise invalid(
                self,
                "localization",
                list(self.localization),
                "must be empty, because the autopilot localizes itself",
                "choose controller/localization=exact",
            )
        count = round(self.avoidance_period_s / self.period_s)
        if count < 1 or abs(count * self.period_s - self.avoidance_period_s) > 1e-9:
            raise invalid(
                self,
                "avoidance_period_s",
                self.avoidance_period_s,
                f"must be a whole multiple of period_s ({self.period_s:g} s)",
                f"set it to {max(1, count) * self.period_s:g}",
            )
