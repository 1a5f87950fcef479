"""Compares the worst rows of the table with the numbers that commands print."""

from collections.abc import Iterable, Iterator, Mapping

from rows import Subject

from evoros.analysis.statistics.small_samples import INTERVALS, TESTS, Shortfall

COVERED, WRONG = 93, 7
"""Percentages: an interval that covers less is short, and so is a test that errs more."""
OUTLIER = "1 in 100"
Cells = Iterable[tuple[str, float]]
"""Columns and measured percentages, of all rows of a subject."""


def find_shortfall(subject: Subject, cells: Cells) -> Shortfall:
    """Return the worst percentages of a subject, rounded; None: they are good enough."""
    shares: Mapping[bool, list[int]] = {False: [], True: []}
    for column, percent in cells:
        shares[column == OUTLIER].append(round(percent))
    return Shortfall(*(_find_worst(subject, shares[outlier]) for outlier in (False, True)))


def _find_worst(subject: Subject, percentages: list[int]) -> int | None:
    if subject.is_interval:
        return min((x for x in percentages if x < COVERED), default=None)
    return max((x for x in percentages if x > WRONG), default=None)


def get_stated(subject: Subject) -> Shortfall:
    """Return what commands print of a subject; nothing if it is good enough."""
    return (INTERVALS if subject.is_interval else TESTS).get(subject.name, Shortfall(None))


def list_drifts(subject: Subject, cells: Cells, tolerance: float) -> Iterator[str]:
    """Yield what is stated of a subject but was measured otherwise, by more than so much."""
    limit = COVERED if subject.is_interval else WRONG
    pairs = zip(get_stated(subject), find_shortfall(subject, cells), strict=True)
    for values, (stated, measured) in zip(Shortfall._fields, pairs, strict=True):
        known = limit if stated is None else stated
        if abs((limit if measured is None else measured) - known) > tolerance:
            yield (
                f"{subject.name}, {values}: evoros/analysis/statistics/small_samples.py states "
                f"{stated}, measured {measured}; correct it"
            )
