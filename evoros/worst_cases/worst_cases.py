"""The settings of an evaluation's search for the worst cases of a design."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated

from evoros.base.checks import (
    COUNT,
    NOT_NEGATIVE,
    NOT_NEGATIVES,
    WHOLE,
    Rule,
    checked,
    instance_of,
    is_number,
)
from evoros.base.errors import InputError
from evoros.certificate.validation import CONFIDENCE
from evoros.filter.protocol import A_FILTER, Filter
from evoros.filter.silence import Silence
from evoros.mission.plan import MOST_REPEATS

RATE = Rule("a number greater than 0 and at most 1", lambda v: is_number(v) and 0 < v <= 1)


@dataclass(frozen=True)
@checked
class WorstCases:
    """Cases of one failed sensor are tried first, then of two, and so on, until one stops a design.

    All sets of a size are tried at all ``times_s`` if these are at most ``max_cases`` cases.
    Otherwise the search extends the worst smaller sets by one sensor. Then, ``rounds`` of
    ``population`` mutants of the worst exchange sensors and move single failures in time. Each case
    gets up to ``screening`` trials, and the worst ``candidates`` of a size ``trials`` fresh ones.
    By these a case stops a design in a world if its rate of completion is below ``stops_below``,
    and below the rate without a failure.
    """

    most: Annotated[int, COUNT] = 6  # sensors that fail
    times_s: Annotated[Sequence[float], NOT_NEGATIVES] = (0.0, 40.0, 80.0)  # when all of a set fail
    latest_s: Annotated[float, NOT_NEGATIVE] = 80.0  # of mutants, from the first of times_s on
    max_cases: Annotated[int, COUNT] = 500  # of one size that are tried one by one
    rounds: Annotated[int, WHOLE] = 2  # of mutants, at each size
    population: Annotated[int, COUNT] = 24  # mutants of a round
    screening: Annotated[int, COUNT] = 6  # trials of a case, 2 if it is completed in these
    candidates: Annotated[int, COUNT] = 3  # of each size, which get fresh trials
    trials: Annotated[int, COUNT] = 40  # fresh, of a candidate and without a failure
    stops_below: Annotated[float, RATE] = 0.5  # rate of completion in a world
    confidence: Annotated[float, CONFIDENCE] = 0.95  # of the finding, and of each interval
    effect: Annotated[Filter, A_FILTER] = field(default_factory=Silence)  # acts on the readings

    def __post_init__(self) -> None:
        if self.latest_s < min(self.times_s):
            raise InputError(
                f"worst_cases.latest_s: must be at least the first of worst_cases.times_s "
                f"({min(self.times_s):g}), not {self.latest_s:g}; correct it"
            )
        if self.screening + self.trials > MOST_REPEATS:
            raise InputError(
                f"worst_cases.trials: must be at most {MOST_REPEATS - self.screening}, so that "
                f"they and worst_cases.screening are at most {MOST_REPEATS}, not {self.trials}; "
                f"lower it"
            )


A_SEARCH = instance_of(
    WorstCases, "a search of worst cases (evoros.worst_cases.worst_cases.WorstCases)"
)
