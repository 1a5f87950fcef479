"""Settings for the search for a design's worst cases."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base import checks
from evoros.base.errors import InputError
from evoros.certificate.validation import CONFIDENCE


@dataclass(frozen=True)
@checks.checked
class WorstCases:
    """A search that fails one sensor, then two, and so on, until a case stops the design.

    The search tries all sets of a size at all ``times_s`` if there are at most ``max_cases`` cases.
    Otherwise it extends the worst smaller sets by one sensor. It then screens ``rounds`` rounds of
    ``population`` mutants of the worst cases, in which a sensor is exchanged or a failure moved in
    time. Each case gets up to ``screening`` trials, and the worst ``candidates`` of a size get
    ``trials`` fresh trials. A case stops a design in a world if the completion rate there is below
    ``stops_below`` and below the rate without a failure.
    """

    most: Annotated[int, checks.COUNT] = 6  # maximum number of failed sensors
    # when sets fail
    times_s: Annotated[Sequence[float], checks.NOT_NEGATIVES] = (0.0, 40.0, 80.0)
    latest_s: Annotated[float, checks.NOT_NEGATIVE] = 80.0  # latest failure time of a mutant
    max_cases: Annotated[int, checks.COUNT] = (
        500  # maximum number of cases of a size that are all tried
    )
    rounds: Annotated[int, checks.WHOLE] = 2  # rounds of mutants per size
    population: Annotated[int, checks.COUNT] = 24  # mutants per round
    screening: Annotated[int, checks.COUNT] = 6  # trials per case, or 2 if both are completed
    candidates: Annotated[int, checks.COUNT] = 3  # cases per size that get fresh trials
    trials: Annotated[int, checks.COUNT] = 40  # fresh trials per candidate, and without a failure
    stops_below: Annotated[float, checks.FRACTION] = 0.5  # completion rate in a world
    confidence: Annotated[float, CONFIDENCE] = 0.95  # applies to the finding and each interval

    def __post_init__(self) -> None:
        if self.latest_s < min(self.times_s):
            raise InputError(
                f"worst_cases.latest_s: must be at least the first of worst_cases.times_s "
                f"({min(self.times_s):g}), not {self.latest_s:g}; raise latest_s"
            )


A_SEARCH = checks.instance_of(
    WorstCases, "a search for worst cases (evoros.worst_cases.worst_cases.WorstCases)"
)
