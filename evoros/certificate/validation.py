"""Settings for the validation of champions, and the schedule of precision tests."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evoros.base.checks import COUNT, POSITIVE, WHOLE, Rule, checked, instance_of, is_number
from evoros.base.errors import InputError
from evoros.certificate.rates import LOWER_SHARE, Bounds, bound_mean, share_level

PRECISION = Rule("null or a positive number", lambda v: v is None or POSITIVE.holds(v))
TRIALS = Rule("null or a positive integer", lambda v: v is None or COUNT.holds(v))
CONFIDENCE = Rule("a number from 0.5 to 0.999", lambda v: is_number(v) and 0.5 <= v <= 0.999)


@dataclass(frozen=True)
@checked
class Validation:
    """Trials on fresh draws that estimate the fitness and completion rates of a champion.

    With a ``precision``, trials are added until the fitness interval is narrow enough, or up to
    ``max_trials``. ``list_looks`` sets in advance the numbers of trials after which the interval is
    tested. The tests share the error rate, so early stopping does not reduce the confidence.
    """

    trials: Annotated[int | None, TRIALS] = None  # None: optimizer.validation_trials
    precision: Annotated[float | None, PRECISION] = None  # required half-width of the interval
    max_trials: Annotated[int, COUNT] = 200
    confidence: Annotated[float, CONFIDENCE] = 0.95  # confidence level of each interval
    rivals: Annotated[int, WHOLE] = 0  # number of other designs to validate

    def __post_init__(self) -> None:
        if self.trials is not None and self.trials > self.max_trials:
            raise InputError(
                f"validation.trials: must be at most validation.max_trials ({self.max_trials}), "
                f"not {self.trials}; set validation.max_trials={self.trials}"
            )


A_VALIDATION = instance_of(Validation, "a validation (evoros.certificate.validation.Validation)")


GROWTH = 1.5  # ratio between the numbers of trials at successive looks
FEWEST = 5  # minimum number of trials at the first look
MOST_REPEATS = 10_000


def list_looks(validation: Validation, trials: int, missions: int, room: Bounds) -> list[int]:
    """Return the numbers of trials after which the precision is tested, up to ``max_trials``.

    Each number is at least ``trials``, and large enough for an interval as narrow as the precision.
    ``room`` has the distances from the fitness to its minimum and maximum (0 if unknown), and each
    trial has ``missions`` scores. All arguments must be known before the trials.
    """
    looks = [max(trials, validation.max_trials)]
    while True:
        earlier = int(looks[0] / GROWTH)
        confidence = share_level(validation.confidence, len(looks) + 1)
        if earlier < max(trials, FEWEST) or not _can_be_narrow(
            validation, room, earlier * missions, confidence
        ):
            return looks
        looks.insert(0, earlier)


def foresee_trials(validation: Validation, missions: int, bounds: Sequence[float]) -> str:
    """Describe the minimum number of trials for the precision; empty if unknown."""
    if not _is_known(validation, bounds):
        return ""
    level = (bounds[1] - bounds[0]) / 2
    fewest = list_looks(validation, 1, missions, (level, level))[0]
    return (
        f"validation.precision: a precision of {validation.precision:g} requires at least "
        f"{fewest} trials of the champion ({fewest * missions} missions) at a fitness of "
        f"{bounds[0] + level:g}"
    )


def _is_known(validation: Validation, bounds: Sequence[float]) -> bool:
    return validation.precision is not None and bool(bounds) and all(map(math.isfinite, bounds))


def check_precision(validation: Validation, missions: int, bounds: Sequence[float]) -> None:
    """Check that a design of medium fitness can reach the precision in ``max_trials``."""
    if not _is_known(validation, bounds):
        return
    level = (bounds[1] - bounds[0]) / 2
    room, count = (level, level), validation.max_trials * missions
    if _can_be_narrow(validation, room, count, validation.confidence):
        return
    reached = 1.05 * find_least_width(room, count, validation.confidence) / 2  # rounded up below
    wanted = validation.max_trials
    while not _can_be_narrow(validation, room, wanted * missions, validation.confidence):
        wanted *= 2
    raise InputError(
        f"validation.precision: must be at least {reached:.2g}, not {validation.precision:g}, "
        f"because validation.max_trials={validation.max_trials} cannot give a finer precision at a "
        f"fitness of {bounds[0] + level:g}; raise validation.precision, or set "
        f"validation.max_trials={wanted}"
    )


def find_least_width(room: Bounds, count: int, confidence: float) -> float:
    """Return the interval's width for ``count`` equal scores at these distances from the bounds."""
    errors = (1 - confidence) * LOWER_SHARE, (1 - confidence) * (1 - LOWER_SHARE)
    parts = zip(room, errors, strict=True)
    return sum(width * (1 - float(error ** (1 / count))) for width, error in parts)


def _can_be_narrow(validation: Validation, room: Bounds, count: int, confidence: float) -> bool:
    assert validation.precision is not None
    return find_least_width(room, count, confidence) <= 2 * validation.precision


def estimate_trials(
    scores: Sequence[float],
    trials: int,
    limits: tuple[float, float],
    confidence: float,
    precision: float,
) -> int | None:
    """Estimate the trials needed for a precision from the scores so far; None if out of reach."""

    def is_narrow(repeats: int) -> bool:
        low, high = bound_mean(scores, *limits, confidence, repeats)
        return high - low <= 2 * precision

    few, many = 1, 2
    while not is_narrow(many):
        few, many = many, 2 * many
        if many > MOST_REPEATS:
            return None
    while many - few > 1:
        middle = (few + many) // 2
        few, many = (few, middle) if is_narrow(middle) else (middle, many)
    unit: int = 10 ** max(0, len(str(many * trials)) - 2)  # two significant digits
    return -(-many * trials // unit) * unit
