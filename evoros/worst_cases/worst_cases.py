"""Settings of the search for the worst cases of a design."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import (
    COUNT,
    FRACTION,
    NOT_NEGATIVE,
    NOT_NEGATIVES,
    WHOLE,
    checked,
    instance_of,
)
from evoros.base.errors import InputError
from evoros.certificate.validation import CONFIDENCE


@dataclass(frozen=True)
@checked
class WorstCases:
    """Try failures of one sensor, then of two, and so on, until one case stops the design.

    The search tries all sets of a size at all ``times_s`` if there are at most ``max_cases`` cases.
    Otherwise it extends the worst smaller sets by one sensor. It then screens ``rounds`` of
    ``population`` mutants of the worst cases, which exchange a sensor or move a failure in time.
    Each case gets up to ``screening`` trials, and the worst ``candidates`` of a size get ``trials``
    fresh ones. A case stops a design in a world if the completion rate there is below
    ``stops_below`` and below the rate without a failure.
    """

    most: Annotated[int, COUNT] = 6  # maximum number of failed sensors
    times_s: Annotated[Sequence[float], NOT_NEGATIVES] = (0.0, 40.0, 80.0)  # sets fail together
    latest_s: Annotated[float, NOT_NEGATIVE] = 80.0  # latest failure of a mutant
    max_cases: Annotated[int, COUNT] = 500  # maximum for trying all cases of a size
    rounds: Annotated[int, WHOLE] = 2  # rounds of mutants per size
    population: Annotated[int, COUNT] = 24  # mutants per round
    screening: Annotated[int, COUNT] = 6  # trials per case; 2 if both are completed
    candidates: Annotated[int, COUNT] = 3  # cases per size that get fresh trials
    trials: Annotated[int, COUNT] = 40  # fresh trials of a candidate, and without a failure
    stops_below: Annotated[float, FRACTION] = 0.5  # completion rate in a world
    confidence: Annotated[float, CONFIDENCE] = 0.95  # applies to the finding and each interval

    def __post_init__(self) -> None:
        if self.latest_s < min(self.times_s):
            raise InputError(
                f"worst_cases.latest_s: must be at least the first of worst_cases.times_s "
                f"({min(self.times_s):g}), not {self.latest_s:g}; raise it"
            )


A_SEARCH = instance_of(
    WorstCases, "a search of worst cases (evoros.worst_cases.worst_cases.WorstCases)"
)
